"""The commands that are no stage, one a file; each is imported when it is called."""

from paramreduce_cli.registry import Registry

commands = Registry("command", __name__)
