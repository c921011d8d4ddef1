"""Trajectories in the forms that controllers read, one a file: functions from a motion to files."""

from paramreduce_cli.registry import Registry

trajectory_formats = Registry("trajectory format", __name__)
