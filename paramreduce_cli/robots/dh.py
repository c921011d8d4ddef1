"""Denavit-Hartenberg descriptions: modified as in [Khalil2002] and [Craig2005], and standard."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from paramreduce_cli.records import BASE, Body, FloatArray, Mechanism
from paramreduce_cli.robots.frames import rotation_x, rotation_z, translation


@dataclass(frozen=True)
class DHRow:
    """One body of a Denavit-Hartenberg table.

    The coordinate is added to ``theta`` (revolute) or to ``d`` (prismatic). ``gamma`` and
    ``b`` place a branch on its parent [Khalil2002]; they are zero along a chain.
    """

    name: str
    parent: str | None
    """Name of the parent body, None for the base."""
    joint: Literal["revolute", "prismatic"]
    a: float
    alpha: float
    d: float
    theta: float
    gamma: float = 0.0
    b: float = 0.0


def mechanism_from_dh(
    robot: str,
    rows: Sequence[DHRow],
    convention: Literal["modified", "standard"],
    gravity: Sequence[float],
) -> Mechanism:
    """Build a mechanism from a Denavit-Hartenberg table.

    Args:
        robot: Name of the robot.
        rows: One per body, parents before children; lengths in m, angles in rad.
        convention: ``modified`` puts a body's frame on its own joint's axis, ``standard``
            on the next joint's.
        gravity: In the base frame, (3,), m/s^2.

    Raises:
        KeyError: A parent is not above its child.
    """
    index: dict[str | None, int] = {None: BASE}
    bodies = []
    for row in rows:
        place = _modified if convention == "modified" else _standard
        before, after = place(row)
        offset = row.theta if row.joint == "revolute" else row.d
        coordinate = f"z_{row.name}"
        bodies.append(
            Body(row.name, index[row.parent], row.joint, before, after, coordinate, offset)
        )
        index[row.name] = len(bodies) - 1
    return Mechanism(
        robot,
        tuple(bodies),
        np.asarray(gravity, dtype=float),
        _lengths(rows),
        _table(rows),
    )


def _modified(row: DHRow) -> tuple[FloatArray, FloatArray]:
    before = _branch(row) @ rotation_x(row.alpha) @ translation(row.a, 0.0, 0.0)
    return before @ _still_part(row), np.eye(4)


def _standard(row: DHRow) -> tuple[FloatArray, FloatArray]:
    after = translation(row.a, 0.0, 0.0) @ rotation_x(row.alpha)
    return _branch(row) @ _still_part(row), after


def _branch(row: DHRow) -> FloatArray:
    return rotation_z(row.gamma) @ translation(0.0, 0.0, row.b)


def _still_part(row: DHRow) -> FloatArray:
    """Of theta and d the one that the coordinate does not move; along z the two commute."""
    if row.joint == "revolute":
        return translation(0.0, 0.0, row.d)
    return rotation_z(row.theta)


def _lengths(rows: Sequence[DHRow]) -> dict[str, float]:
    named = ((f"{key}_{row.name}", getattr(row, key)) for row in rows for key in ("a", "d", "b"))
    return {name: value for name, value in named if value != 0.0}


def _table(rows: Sequence[DHRow]) -> tuple[tuple[str, ...], ...]:
    branching = any(row.gamma or row.b for row in rows)
    header = ["body", "parent", "joint", *(["gamma", "b"] if branching else [])]
    header += ["a", "alpha", "d", "theta"]
    table = [tuple(header)]
    for row in rows:
        angle, length = _angle_text(row.theta), f"{row.d:g}"
        if row.joint == "revolute":
            angle = _with_coordinate(row.theta, angle, row.name)
        else:
            length = _with_coordinate(row.d, length, row.name)
        cells = [row.name, row.parent or "base", row.joint]
        if branching:
            cells += [_angle_text(row.gamma), f"{row.b:g}"]
        cells += [f"{row.a:g}", _angle_text(row.alpha), length, angle]
        table.append(tuple(cells))
    return tuple(table)


def _with_coordinate(offset: float, text: str, name: str) -> str:
    return f"z_{name}" if offset == 0 else f"z_{name} + {text}"


def _angle_text(angle: float) -> str:
    for denominator in (1, 2, 3, 4, 6):
        multiple = angle * denominator / np.pi
        if abs(multiple - round(multiple)) < 1e-12:
            top = round(multiple)
            if top == 0:
                return "0"
            sign, top = ("-" if top < 0 else ""), abs(top)
            return (
                f"{sign}{'' if top == 1 else top}pi{'' if denominator == 1 else f'/{denominator}'}"
            )
    return f"{angle:g}"
