"""The equations that close the loops of a mechanism, symbolically.

Phi(q) = 0 in the generalised coordinates of the open tree; lengths are in m and directions
without unit, so that every equation is about as large as the gap it measures.
"""

from collections.abc import Sequence

import casadi as ca

from paramreduce_cli.expressions.vectors import Vector, dot, subtract
from paramreduce_cli.multibody.kinematics import (
    JointMotion,
    direction_in_base,
    motions,
    point_in_base,
)
from paramreduce_cli.records import Closure, Mechanism

EQUATIONS: dict[str, tuple[str, ...]] = {
    "fixed": ("x", "y", "z", "tilt x", "tilt y", "turn"),
    "revolute": ("x", "y", "z", "tilt x", "tilt y"),
    "prismatic": ("x", "y", "tilt x", "tilt y", "turn"),
    "cylindrical": ("x", "y", "tilt x", "tilt y"),
    "universal": ("x", "y", "z", "angle"),
    "point": ("x", "y", "z"),
    "planar": ("x", "y"),
    "distance": ("distance",),
    "coupling": ("coordinates",),
}
"""What each equation of a kind of closure measures."""


def closure_equations(mechanism: Mechanism, q: ca.SX) -> ca.SX:
    """Phi(q), all closures stacked, without what follows from the rest, (n_equations,).

    Args:
        mechanism: With loops.
        q: Generalised coordinates, (n_q,), rad or m.
    """
    if mechanism.loops is None:
        return ca.SX(0, 1)
    joints, kept = motions(mechanism, q), mechanism.loops.kept
    equations = [e for c in mechanism.loops.closures for e in _equations(joints, c, q)]
    return ca.vertcat(*(e for k, e in enumerate(equations) if kept is None or k in kept))


def equation_owners(closures: Sequence[Closure]) -> list[tuple[str, str]]:
    """For every equation in order the kind of its closure, and its name for people."""
    return [(c.kind, f"{c.name} ({part})") for c in closures for part in EQUATIONS[c.kind]]


def _equations(joints: list[JointMotion], closure: Closure, q: ca.SX) -> list[ca.SX]:
    (a, b), (A, B) = closure.bodies, closure.frames
    if closure.kind == "coupling":
        return [q[b] - closure.ratio * q[a] - closure.offset]
    start, end = point_in_base(joints, a, A[:3, 3]), point_in_base(joints, b, B[:3, 3])
    gap = subtract(end, start)
    if closure.kind == "distance":
        length = closure.length
        return [(dot(gap, gap) - length**2) / (2 * length)]

    def along(axes: Sequence[int], other: Vector) -> list[ca.SX]:
        """Components along some axes of A."""
        return [dot(direction_in_base(joints, a, A[:3, k]), other) for k in axes]

    def axis(k: int) -> Vector:
        """Of B."""
        return direction_in_base(joints, b, B[:3, k])

    if closure.kind == "planar":
        return along((0, 1), gap)
    if closure.kind == "point":
        return list(gap)
    if closure.kind == "universal":
        return [*gap, *along((0,), axis(1))]
    if closure.kind not in EQUATIONS:
        raise ValueError(f"there is no closure of the kind {closure.kind!r}")
    place = along((0, 1), gap) if closure.kind in ("prismatic", "cylindrical") else list(gap)
    turn = along((1,), axis(0)) if closure.kind in ("prismatic", "fixed") else []
    return [*place, *along((0, 1), axis(2)), *turn]
