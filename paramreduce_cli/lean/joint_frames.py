"""A mechanism's tree in frames that suit it: one on every joint's axis, parallel axes aligned.

A body's frame here is its joint's, moved with the body, z along the axis. Seen from the frame
of the body before, it is ``place``, ``turn`` (the joint's frame at rest), then the joint's
motion. Frames are free up to a turn about their own z and the direction of z, so that an axis
parallel to the one before gets no turn at all: its angle just adds to that one's.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.expressions.programs import Program
from paramreduce_cli.multibody.drive_motions import make_motion_function
from paramreduce_cli.records import BASE, Drive, FloatArray, Kind, Mechanism, Rigid
from paramreduce_cli.robots.frames import clean_rotation

_FLIP = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True)
class Joint:
    """A joint and the body it moves."""

    parent: int
    """Index of the parent body's joint; :data:`BASE` for the base."""
    revolute: bool
    sign: int
    """-1 if the frame's z axis is opposite to the joint's axis as described, else 1."""
    offset: float
    """Offset added to the signed coordinate, rad or m."""
    place: FloatArray
    """Position of the origin in the parent body's frame, m, (3,)."""
    rotation: FloatArray
    """Rotation matrix from the joint's frame at rest to the parent body's frame, (3, 3)."""
    parallel: bool
    """Whether the axis is parallel to that of the parent's joint, so that the angles can be added."""
    described_to_axis: FloatArray
    """Homogeneous transform from the body's frame as described to this one, (4, 4), m."""
    rigid: tuple[Rigid, ...]
    """The moved body and its payloads; their columns are positions among the inputs of all models."""

    @property
    def columns(self) -> tuple[int, ...]:
        """All their columns."""
        return tuple(column for rigid in self.rigid for column in rigid.columns.values())


@dataclass(frozen=True)
class TreeDrive:
    """A drive or force element of a tree."""

    drive: Drive
    columns: Mapping[Kind, int]
    """Positions of its parameters among the inputs of all models, by kind."""
    motion: Program | None
    """Program from q and dq to the motion between two frames; None for a weighted sum of coordinates."""


@dataclass(frozen=True)
class Tree:
    """The joints of a mechanism's tree, parents before their children, in the order of the bodies."""

    joints: tuple[Joint, ...]
    gravity: FloatArray
    """Gravity in the base frame, m/s^2, (3,)."""
    n_parameters: int
    """Number of parameters of all bodies."""
    carried: bool = False
    """Whether it is a part of a larger tree, whose motion carries it: the base moves."""
    drives: tuple[TreeDrive, ...] = ()
    """Drives and force elements; a part of a tree has none."""
    nominal: FloatArray | None = None
    """Nominal values of the parameters, (n_parameters,), if friction depends on the load."""


def choose_frames(mechanism: Mechanism) -> Tree:
    """Choose the frames of a mechanism's bodies so that the recursion takes few operations."""
    joints: list[Joint] = []
    for i, body in enumerate(mechanism.bodies):
        before = None if body.parent == BASE else joints[body.parent]
        placed = body.parent_to_joint
        if before is not None:
            placed = before.described_to_axis @ placed
        rotation, after, sign = clean_rotation(placed[:3, :3]), body.joint_to_body.copy(), 1
        parallel = before is not None and not _has_tilt(rotation)
        if parallel and rotation[2, 2] < 0:
            rotation, sign = rotation @ _FLIP, -1
            after[:3] = _FLIP @ after[:3]
        offset = sign * body.offset
        if body.joint == "revolute" and before is not None:
            rotation, angle = _split_rotation_about_z(rotation)
            offset += angle
        elif parallel:
            after[:3] = rotation @ after[:3]
            rotation = np.eye(3)
        after[:3, :3] = clean_rotation(after[:3, :3])
        joints.append(
            Joint(
                parent=body.parent,
                revolute=body.joint == "revolute",
                sign=sign,
                offset=offset,
                place=placed[:3, 3],
                rotation=rotation,
                parallel=parallel,
                described_to_axis=after,
                rigid=mechanism.list_rigid_parts(i),
            )
        )
    drives = tuple(
        TreeDrive(
            drive, mechanism.find_drive_columns(drive), _make_motion_program(mechanism, drive)
        )
        for drive in mechanism.drives
    )
    return Tree(
        tuple(joints),
        mechanism.gravity,
        mechanism.n_parameters,
        drives=drives,
        nominal=mechanism.nominal,
    )


def _make_motion_program(mechanism: Mechanism, drive: Drive) -> Program | None:
    """Return the program of a motion between two frames, or None for a weighted sum of coordinates."""
    if drive.between is None:
        return None
    return Program.from_function(make_motion_function(mechanism, drive.between))


def _has_tilt(rotation: FloatArray) -> bool:
    """Whether a rotation moves the z axis, however little: the cosine alone would not show it."""
    return bool(np.any(rotation[[2, 2, 0, 1], [0, 1, 2, 2]]))


def _split_rotation_about_z(turn: FloatArray) -> tuple[FloatArray, float]:
    """Split a rotation matrix into the rest and the angle of a rotation about z that is applied first, and return both
    in this order. The angle is zero if the matrix is a permutation of axes that moves the z axis.

    Permutations of axes cost no operations; for others, taking out the rotation about z saves products.
    """
    if np.all((turn == 0) | (np.abs(turn) == 1)) and _has_tilt(turn):
        return turn, 0.0
    sine, cosine = (turn[2, 0], turn[2, 1]) if _has_tilt(turn) else (turn[1, 0], turn[0, 0])
    angle = float(np.arctan2(sine, cosine))
    c, s = np.cos(angle), np.sin(angle)
    return clean_rotation(turn @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])), angle
