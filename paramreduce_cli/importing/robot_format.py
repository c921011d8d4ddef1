"""Base class of the kinds of robot files."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from paramreduce_cli.importing.imported_robot import ImportedRobot, Inertial
from paramreduce_cli.importing.simplification import SimplifiedRobot
from paramreduce_cli.records import Kind

Writer = Callable[
    [Path, SimplifiedRobot, Mapping[str, Inertial | None], Mapping[str, Mapping[str, float]]], bytes
]
"""Returns a file with other inertias, by body, and other drives, by body and key."""


@dataclass(frozen=True)
class RobotFormat:
    """A kind of robot file: how it is read and written back."""

    tag: str
    """Tag of the outermost element."""
    read: Callable[[Path], ImportedRobot]
    write: Writer
    held: tuple[Kind, ...]
    """Parameters of drives that the files have a place for."""
    holds_gravity: bool
    """Whether a file says what gravity is."""
    physical: bool
    """Whether a file holds only bodies that some distribution of mass has."""
