"""A robot as a file of another kind describes it: links, and joints between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from paramreduce_cli.records import FloatArray
from paramreduce_cli.robots.placement import Step, transform

JointKind = Literal["revolute", "continuous", "prismatic", "fixed", "floating", "planar"]
JOINT_KINDS: tuple[JointKind, ...] = (
    "revolute", "continuous", "prismatic", "fixed", "floating", "planar",
)  # fmt: skip

Steps = tuple[tuple[str, float | tuple[float, ...]], ...]
"""A placement, step by step: ``xyz`` with a shift in m, or ``rx``, ``ry``, ``rz`` with an angle."""


def matrix(steps: Steps) -> FloatArray:
    """Steps as a homogeneous transform, (4, 4), m."""
    return transform([Step.model_validate({key: value}) for key, value in steps])


@dataclass(frozen=True)
class Inertial:
    """Mass, kg, centre of mass, (3,), m, and inertia about it, (3, 3), kg m^2, in some frame."""

    mass: float = 0.0
    com: FloatArray = field(default_factory=lambda: np.zeros(3))
    tensor: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))

    def seen(self, frame: FloatArray) -> Inertial:
        """The same in another frame.

        Args:
            frame: Of the present frame in the other, (4, 4).
        """
        R = frame[:3, :3]
        return Inertial(self.mass, R @ self.com + frame[:3, 3], R @ self.tensor @ R.T)


def together(parts: Sequence[Inertial]) -> Inertial:
    """Bodies that are one, in one frame."""
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
    """A coordinate is ``ratio`` times that of another joint plus ``offset``."""

    joint: str
    ratio: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class ImportedJoint:
    """What a file says of a joint."""

    name: str
    kind: JointKind
    parent: str
    child: str
    origin: Steps
    """Of the child's frame in the parent's."""
    axis: tuple[float, float, float]
    """In the child's frame, of unit length; the normal of a planar joint."""
    lower: float | None = None
    """rad or m; None where the file gives no limit."""
    upper: float | None = None
    velocity: float | None = None
    effort: float | None = None
    mimic: Mimic | None = None
    """What its coordinate follows, if it is not its own."""
    drive: Mapping[str, float] = field(default_factory=dict)
    """Friction, rotor and spring by the keys of a drive in a config; those that are not zero."""
    line: int = 0


@dataclass(frozen=True)
class ImportedRobot:
    """Links and joints as a file gives them, in its order."""

    name: str
    source: str
    """The file, for messages."""
    links: dict[str, Inertial | None]
    """By name; None where the file gives no inertia."""
    joints: tuple[ImportedJoint, ...]
    remarks: tuple[str, ...] = ()
    """What was changed while reading, such as angles taken for what they were rounded from."""
