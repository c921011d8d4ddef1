"""Bodies and joints in frames of their own choice, with closures that make loops of them.

A joint of several axes becomes a chain of joints of one axis with massless bodies between.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from paramreduce_cli.records import BASE, Body, Closure, FloatArray, Loops, Mechanism

Motion = tuple[Literal["revolute", "prismatic"], FloatArray]
"""A kind of motion and the direction of its axis, (3,)."""

_X, _Y, _Z = np.eye(3)
_NO_TURN = 1e-12
"""What is printed as zero, rad or m."""


def joint_motions(kind: str, axes: Sequence[Sequence[float]]) -> list[Motion]:
    """The motions of a joint, one after the other.

    Args:
        kind: ``revolute``, ``prismatic``, ``universal``, ``spherical`` or ``free``.
        axes: Directions of its axes, as many as :data:`paramreduce_cli.records.JOINT_AXES` says; if empty, z for one axis,
            x then y for a universal joint. Spherical joints turn about x, y and z, free ones
            slide along them first.

    """
    if kind == "spherical":
        return [("revolute", axis) for axis in (_X, _Y, _Z)]
    if kind == "free":
        slides: list[Motion] = [("prismatic", axis) for axis in (_X, _Y, _Z)]
        return slides + joint_motions("spherical", [])
    if kind == "universal":
        first, second = axes or (_X, _Y)
        return [("revolute", np.asarray(first)), ("revolute", np.asarray(second))]
    (axis,) = axes or (_Z,)
    return [("revolute" if kind == "revolute" else "prismatic", np.asarray(axis, dtype=float))]


@dataclass(frozen=True)
class TreeBody:
    """One body with the joint that carries it."""

    name: str
    parent: str | None
    """Name of the parent body, None for the base."""
    joint: str
    axes: tuple[tuple[float, float, float], ...] = ()
    placement: FloatArray = field(default_factory=lambda: np.eye(4))
    """Homogeneous transform from the parent's frame to the joint's, (4, 4), m."""
    coordinates: tuple[str, ...] = ()
    massless: bool = False


@dataclass(frozen=True)
class LoopClosure:
    """A closure between two named bodies; ``None`` is the base."""

    name: str
    kind: Literal["point", "planar", "revolute", "distance"]
    bodies: tuple[str | None, str | None]
    frames: tuple[FloatArray, FloatArray]
    length: float = 0.0


def mechanism_from_bodies(
    robot: str,
    rows: Sequence[TreeBody],
    gravity: Sequence[float],
    closures: Sequence[LoopClosure] = (),
    independent: Sequence[str] = (),
    guess: Mapping[str, float] | None = None,
) -> Mechanism:
    """Build a mechanism from bodies and closures.

    Args:
        robot: Name of the robot.
        rows: Parents before children.
        gravity: In the base frame, (3,), m/s^2.
        closures: What closes the loops.
        independent: Names of the independent coordinates; of no meaning without closures.
        guess: Values of coordinates near an assembly; zero for those left out.

    Raises:
        KeyError: A parent is not above its child, or a body is not known.
        ValueError: An independent coordinate is not known.
    """
    bodies: list[Body] = []
    index: dict[str | None, int] = {None: BASE}
    for row in rows:
        bodies += _chain(row, index[row.parent], len(bodies))
        index[row.name] = len(bodies) - 1
    names = [body.coordinate for body in bodies]
    loops = None
    if closures:
        values = guess or {}
        loops = Loops(
            tuple(
                Closure(
                    c.name, c.kind, (index[c.bodies[0]], index[c.bodies[1]]), c.frames, c.length
                )
                for c in closures
            ),
            tuple(names.index(name) for name in independent),
            np.array([float(values.get(name, 0.0)) for name in names]),
        )
    table = _table(rows, closures)
    return Mechanism(robot, tuple(bodies), np.asarray(gravity, dtype=float), {}, table, loops)


def _chain(row: TreeBody, parent: int, start: int) -> list[Body]:
    """The bodies of one joint: massless ones between its axes, the named one at its end."""
    motions = joint_motions(row.joint, row.axes)
    chain = []
    place = row.placement
    for k, (kind, axis) in enumerate(motions):
        last = k == len(motions) - 1
        turn = np.eye(4)
        turn[:3, :3] = rotation_to(axis)
        chain.append(
            Body(
                name=row.name if last else f"{row.name}:{k + 1}",
                parent=parent if k == 0 else start + k - 1,
                joint=kind,
                before=place @ turn,
                after=turn.T,
                coordinate=row.coordinates[k],
                massless=row.massless or not last,
            )
        )
        place = np.eye(4)
    return chain


def rotation_to(axis: FloatArray) -> FloatArray:
    """A rotation that takes z to a direction, (3, 3); without rounding for the six axes."""
    unit = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    for k, direction in enumerate(np.eye(3)):
        if np.array_equal(np.abs(unit), direction):
            cyclic = np.roll(np.eye(3), k + 1, axis=0)
            return cyclic if unit[k] > 0 else cyclic @ np.diag([1.0, -1.0, -1.0])
    if unit[2] < 0:
        return rotation_to(-unit) @ np.diag([1.0, -1.0, -1.0])
    x, y, c = unit
    skew = np.array([[0, 0, x], [0, 0, y], [-x, -y, 0]])  # of z cross the axis
    result: FloatArray = np.eye(3) + skew + skew @ skew / (1 + c)
    return result


def _table(
    rows: Sequence[TreeBody], closures: Sequence[LoopClosure]
) -> tuple[tuple[str, ...], ...]:
    table = [("body", "on", "joint", "axes", "at", "coordinates")]
    for row in rows:
        axes = [axis for _, axis in joint_motions(row.joint, row.axes)]
        table.append(
            (
                row.name + (" (massless)" if row.massless else ""),
                row.parent or "base",
                row.joint,
                "; ".join(_numbers(axis) for axis in axes) if len(axes) < 3 else "x y z",
                _placement_text(row.placement),
                " ".join(row.coordinates),
            )
        )
    for closure in closures:
        bodies = " - ".join(name or "base" for name in closure.bodies)
        kind = f"{closure.kind} {closure.length:g}" if closure.length else closure.kind
        places = "; ".join(_placement_text(frame) for frame in closure.frames)
        table.append((closure.name, bodies, f"closure: {kind}", "", places, ""))
    return tuple(table)


def _placement_text(placement: FloatArray) -> str:
    """Where a frame is, and about which axis and by how much it is turned."""
    text = _numbers(placement[:3, 3])
    turn = Rotation.from_matrix(placement[:3, :3]).as_rotvec()
    angle = float(np.linalg.norm(turn))
    if angle < _NO_TURN:
        return text
    return f"{text}, turned {angle:.4g} about {_numbers(turn / angle)}"


def _numbers(values: Sequence[float] | FloatArray) -> str:
    return " ".join(f"{value:.4g}" for value in np.where(np.abs(values) < _NO_TURN, 0.0, values))
