"""Closure equations of loops, as expressions.

Phi(q) = 0 in the generalised coordinates of the open tree; lengths are in m and directions
without unit, so that every equation is about as large as the gap it measures.
"""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import NamedTuple

import casadi as ca

from paramreduce_cli.expressions.vectors import Vector, dot, subtract
from paramreduce_cli.multibody.kinematics import (
    JointMotion,
    make_joint_motions,
    transform_direction,
    transform_point,
)
from paramreduce_cli.records import BASE, Closure, ClosureKind, Mechanism


def express_equations(mechanism: Mechanism, q: ca.SX) -> ca.SX:
    """Return Phi(q), all closures stacked, without equations that follow from the rest, (n_equations,).

    Args:
        mechanism: Mechanism with loops.
        q: Generalised coordinates, (n_q,), rad or m.
    """
    if mechanism.loops is None:
        return ca.SX(0, 1)
    joints, kept = make_joint_motions(mechanism, q), mechanism.loops.kept
    equations = [
        e for c in mechanism.loops.closures for e in _ClosedPair(joints, c, q).express_equations()
    ]
    return ca.vertcat(*(e for k, e in enumerate(equations) if kept is None or k in kept))


def list_owners(closures: Sequence[Closure]) -> list[tuple[str, str]]:
    """Return the kind of the closure of every equation in order, and its name for people."""
    return [(c.kind, f"{c.name} ({part})") for c in closures for part in CLOSURES[c.kind].equations]


class _ClosedPair:
    """The frames A and B that a closure holds together.

    Args:
        joints: Motions of the joints.
        closure: The closure.
        q: Generalised coordinates, (n_q,), rad or m.
    """

    def __init__(self, joints: list[JointMotion], closure: Closure, q: ca.SX) -> None:
        self._joints, self.closure, self.q = joints, closure, q

    def express_equations(self) -> list[ca.SX]:
        """Return the expressions that are zero where the closure holds.

        Raises:
            ValueError: The kind of closure is unknown.
        """
        if self.closure.kind not in CLOSURES:
            raise ValueError(f"there is no closure of the kind {self.closure.kind!r}")
        return CLOSURES[self.closure.kind].measure(self)

    @cached_property
    def _ancestor(self) -> int:
        """The nearest body that carries both bodies, whose motion does not change the equations."""
        first, second = (self._list_carriers(body) for body in self.closure.bodies)
        return next(body for body in first if body in second)

    def _list_carriers(self, body: int) -> list[int]:
        """Return a body and all that carry it, the base last."""
        carriers = [body]
        while carriers[-1] != BASE:
            carriers.append(self._joints[carriers[-1]].body.parent)
        return carriers

    @property
    def gap(self) -> Vector:
        """Origin of B from that of A, in the frame of their nearest common ancestor, m."""
        start, end = (
            transform_point(self._joints, body, frame[:3, 3], self._ancestor)
            for body, frame in zip(self.closure.bodies, self.closure.frames, strict=True)
        )
        return subtract(end, start)

    def get_axis(self, k: int) -> Vector:
        """Return axis k of B in the frame of the nearest common ancestor."""
        return transform_direction(
            self._joints, self.closure.bodies[1], self.closure.frames[1][:3, k], self._ancestor
        )

    def project(self, axes: Sequence[int], vector: Vector) -> list[ca.SX]:
        """Return the components of a vector, given in the frame of the nearest common ancestor, along some axes of A."""
        a, A = self.closure.bodies[0], self.closure.frames[0]
        directions = (transform_direction(self._joints, a, A[:3, k], self._ancestor) for k in axes)
        return [dot(direction, vector) for direction in directions]

    @property
    def tilt(self) -> list[ca.SX]:
        """Components of the z axis of B along the x and the y axis of A."""
        return self.project((0, 1), self.get_axis(2))

    @property
    def turn(self) -> list[ca.SX]:
        """Component of the x axis of B along the y axis of A."""
        return self.project((1,), self.get_axis(0))


def _express_distance(pair: _ClosedPair) -> list[ca.SX]:
    """Return the error of a distance closure, m."""
    length = pair.closure.length
    return [(dot(pair.gap, pair.gap) - length**2) / (2 * length)]


def _express_coupling(pair: _ClosedPair) -> list[ca.SX]:
    """Return the error of a coupling of two coordinates."""
    (a, b), closure = pair.closure.bodies, pair.closure
    return [pair.q[b] - closure.ratio * pair.q[a] - closure.offset]


class ClosureType(NamedTuple):
    """A type of closure, with its equations."""

    equations: tuple[str, ...]
    """Meaning of each equation."""
    measure: Callable[[_ClosedPair], list[ca.SX]]
    parallel: tuple[int, ...] = ()
    """Axes of the two frames that point the same way."""


_PLACE, _TILT = ("x", "y", "z"), ("tilt x", "tilt y")
CLOSURES: dict[ClosureKind, ClosureType] = {
    "fixed": ClosureType((*_PLACE, *_TILT, "turn"), lambda p: [*p.gap, *p.tilt, *p.turn], (2, 0)),
    "revolute": ClosureType((*_PLACE, *_TILT), lambda p: [*p.gap, *p.tilt], (2,)),
    "prismatic": ClosureType(
        ("x", "y", *_TILT, "turn"), lambda p: [*p.project((0, 1), p.gap), *p.tilt, *p.turn], (2, 0)
    ),
    "cylindrical": ClosureType(
        ("x", "y", *_TILT), lambda p: [*p.project((0, 1), p.gap), *p.tilt], (2,)
    ),
    "universal": ClosureType(
        (*_PLACE, "angle"), lambda p: [*p.gap, *p.project((0,), p.get_axis(1))]
    ),
    "point": ClosureType(_PLACE, lambda p: list(p.gap)),
    "planar": ClosureType(("x", "y"), lambda p: p.project((0, 1), p.gap)),
    "distance": ClosureType(("distance",), _express_distance),
    "coupling": ClosureType(("coordinates",), _express_coupling),
}
"""All kinds of closures."""
