"""Files of robots that are read, a file of this folder each; its function returns a :class:`RobotFormat`."""

from paramreduce_cli.registry import Registry

formats = Registry("robot format", __name__)
