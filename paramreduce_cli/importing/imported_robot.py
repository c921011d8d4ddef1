"""A robot as a file describes it: links, and joints between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from paramreduce_cli.importing.angles import clear_rounding
from paramreduce_cli.records import ClosureKind, FloatArray
from paramreduce_cli.robots.placement import Step, compose_steps

JointKind = Literal["revolute", "continuous", "prismatic", "fixed", "floating", "planar", "ball"]

Steps = tuple[tuple[str, float | tuple[float, ...]], ...]
"""A placement, step by step: ``xyz`` with a shift in m, or ``rx``, ``ry``, ``rz`` with an angle."""


_NO_TURN = 1e-9
"""Angles and entries of rotations below are round-off, rad."""


def decompose_transform(frame: FloatArray) -> Steps:
    """Return a homogeneous transform, (4, 4), as steps: a shift, then yaw, pitch and roll."""
    R = frame[:3, :3]
    flat = float(np.hypot(R[0, 0], R[1, 0]))
    pitch = np.arctan2(-R[2, 0], flat)
    yaw, roll = np.arctan2(R[1, 0], R[0, 0]), np.arctan2(R[2, 1], R[2, 2])
    if flat < _NO_TURN:  # the roll turns about the same axis
        yaw, roll = np.arctan2(-R[0, 1], R[1, 1]), 0.0
    shift = tuple(clear_rounding(float(x)) for x in frame[:3, 3])
    turns = [
        (key, _round_to_15_degrees(float(a)))
        for key, a in (("rz", yaw), ("ry", pitch), ("rx", roll))
    ]
    moved: Steps = (("xyz", shift),) if any(shift) else ()
    return (*moved, *((key, angle) for key, angle in turns if angle))


def _round_to_15_degrees(angle: float) -> float:
    """Return an angle without the round-off of a multiple of 15 degrees."""
    nice = round(angle / (np.pi / 12)) * np.pi / 12
    return nice if abs(angle - nice) < _NO_TURN else angle


def to_transform(steps: Steps) -> FloatArray:
    """Return the homogeneous transform, (4, 4), m, of steps."""
    return compose_steps([Step.model_validate({key: value}) for key, value in steps])


@dataclass(frozen=True)
class Inertial:
    """A mass, kg, its centre, (3,), m, and the inertia about the centre, (3, 3), kg m^2, in some frame."""

    mass: float = 0.0
    com: FloatArray = field(default_factory=lambda: np.zeros(3))
    tensor: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))

    def transform(self, frame: FloatArray) -> Inertial:
        """Return the inertia in another frame.

        Args:
            frame: Pose of the present frame in the other frame, (4, 4).
        """
        R = frame[:3, :3]
        return Inertial(self.mass, R @ self.com + frame[:3, 3], R @ self.tensor @ R.T)

    def negate(self) -> Inertial:
        """Return the inertia that removes this one when it is added to a body."""
        return Inertial(-self.mass, self.com, -self.tensor)


def merge_inertias(parts: Sequence[Inertial]) -> Inertial:
    """Return the inertia of bodies that move as one, all in the same frame."""
    mass = sum(part.mass for part in parts)
    moment = sum((part.mass * part.com for part in parts), np.zeros(3))
    com = moment / mass if mass else np.zeros(3)
    tensor = np.zeros((3, 3))
    for part in parts:
        r = part.com - com
        tensor += part.tensor + part.mass * (r @ r * np.eye(3) - np.outer(r, r))
    return Inertial(mass, com, tensor)


@dataclass(frozen=True)
class Mimic:
    """A mimic joint's rule: its coordinate is ``ratio`` times that of another joint plus ``offset``."""

    joint: str
    ratio: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class ImportedJoint:
    """A joint as a file describes it."""

    name: str
    kind: JointKind
    parent: str
    child: str
    origin: Steps
    """Origin of the child's frame in the parent's."""
    axis: tuple[float, float, float]
    """Axis in the child's frame, of unit length; the normal of a planar joint."""
    lower: float | None = None
    """rad or m; None where the file gives no limit."""
    upper: float | None = None
    velocity: float | None = None
    effort: float | None = None
    mimic: Mimic | None = None
    """Joint that the coordinate follows; None for a coordinate of its own."""
    drive: Mapping[str, float] = field(default_factory=dict)
    """Friction, rotor and spring by the keys of a drive in a config; those that are not zero."""
    line: int = 0

    @property
    def is_limited(self) -> bool:
        """Whether the file limits the coordinate to a range, rad or m."""
        lower, upper = self.lower, self.upper
        return (
            self.kind != "continuous" and lower is not None and upper is not None and lower < upper
        )

    def is_within_limits(self, coordinate: float) -> bool:
        """Return whether a coordinate, rad or m, lies between the limits of the file."""
        lower, upper = self.lower, self.upper
        return (lower is None or lower <= coordinate) and (upper is None or coordinate <= upper)


CLOSED_KINDS: Mapping[str, ClosureKind] = {
    "fixed": "fixed",
    "revolute": "revolute",
    "spherical": "point",
}
"""Kinds of closures of two frames of a file, by what they are asked for as."""


@dataclass(frozen=True)
class ImportedClosure:
    """A closure that holds two links together besides the joints of the tree."""

    name: str
    kind: ClosureKind
    links: tuple[str, str]
    frames: tuple[FloatArray, FloatArray]
    """Frames on both links, in the links' frames, (4, 4), m."""


@dataclass(frozen=True)
class ImportedRobot:
    """A robot of links and joints as a file gives them, in the order of the file."""

    name: str
    source: str
    """The file, for messages."""
    links: dict[str, Inertial | None]
    """Links by name; None where the file gives no inertia."""
    joints: tuple[ImportedJoint, ...]
    massless: frozenset[str] = frozenset()
    """Links that are but frames between joints."""
    gravity: tuple[float, ...] = (0.0, 0.0, -9.81)
    """m/s^2, in the frame of the root."""
    closures: tuple[ImportedClosure, ...] = ()
    independent: tuple[tuple[str, int], ...] = ()
    """Joints, and which of their coordinates, that determine all others; where there are closures."""
    warnings: tuple[str, ...] = ()
    """Changes made while reading, such as rounded angles replaced by exact ones."""
