"""Ways to describe a robot: one class each, with its schema and what it makes of a mechanism."""

from paramreduce_cli.robots.description import Description, Robot
from paramreduce_cli.robots.dh import DHDescription
from paramreduce_cli.robots.tree import TreeDescription

__all__ = ["DHDescription", "Description", "Robot", "TreeDescription"]
