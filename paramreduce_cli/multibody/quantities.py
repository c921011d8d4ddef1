"""Bounded quantities of a mechanism: their values, and smooth rows that are negative inside.

The rows are made so that they are smooth where the quantities are not (an angle of zero, a
point on the axis), without unit, and about as large as the share by which a bound is missed.
"""

from collections.abc import Sequence
from functools import cached_property

import casadi as ca
import numpy as np

from paramreduce_cli.expressions.compiled import BatchFunction
from paramreduce_cli.expressions.vectors import Vector, cross, dot, subtract
from paramreduce_cli.multibody.kinematics import (
    JointMotion,
    make_joint_motions,
    transform_direction,
    transform_point,
)
from paramreduce_cli.multibody.loops.projection import Projection
from paramreduce_cli.records import DISTANCES, Constraint, FloatArray, Mechanism

_SHARP = 40.0
"""Exponent of smooth minima over spheres."""
_NEAR = 0.1
"""m: unit of distances from planes."""


class Quantities:
    """A set of bounded quantities of a mechanism, evaluated on many configurations.

    Args:
        mechanism: Mechanism with the bounded quantities.
        constraints: Constraints, each with one or two bounds.
    """

    def __init__(self, mechanism: Mechanism, constraints: Sequence[Constraint]) -> None:
        self.mechanism = mechanism
        self.constraints = tuple(constraints)
        sides = [(c.upper < np.inf) + (c.lower > -np.inf) for c in constraints]
        self.owners = np.repeat(np.arange(len(sides)), sides)
        """Index of the constraint that each row belongs to, (n_rows,)."""

    @cached_property
    def _values(self) -> BatchFunction:
        """Compiled quantities in their units."""
        q, measures = self._symbols
        return BatchFunction([q], [ca.vertcat(*map(_express_quantity, measures, self.constraints))])

    @cached_property
    def _rows(self) -> BatchFunction:
        return BatchFunction([self._symbols[0]], [self._bounded])

    @cached_property
    def _jacobian(self) -> BatchFunction:
        """Compiled derivatives of the rows by the independent coordinates."""
        q, loop = self._symbols[0], self._projection
        by_q = ca.jacobian(self._bounded, q)
        by_z = by_q if loop is None else loop.compute_vector_jacobian_product(by_q.T).T
        return BatchFunction([q], [by_z.T])

    @cached_property
    def _projection(self) -> Projection | None:
        return None if self.mechanism.loops is None else Projection(self.mechanism)

    @cached_property
    def _symbols(self) -> tuple[ca.MX, list[ca.MX]]:
        """Symbols of the coordinates, and one smooth expression for each constraint."""
        q = ca.SX.sym("q", self.mechanism.n_q)
        joints = make_joint_motions(self.mechanism, q)
        inner = ca.Function(
            "measures", [q], [_express_measure(joints, q, c) for c in self.constraints]
        )
        loop = self._projection
        symbol = ca.MX.sym("q", self.mechanism.n_q) if loop is None else loop.q
        measures = inner.call([symbol])
        for k, constraint in enumerate(self.constraints):
            if constraint.kind == "singularity":
                assert loop is not None
                measures[k] = loop.distance
        return symbol, measures

    @cached_property
    def _bounded(self) -> ca.MX:
        """Rows of all bounds, as an expression."""
        pairs = zip(self._symbols[1], self.constraints, strict=True)
        return ca.vertcat(*(row for pair in pairs for row in _express_rows(*pair)))

    def compute_values(self, q: FloatArray) -> FloatArray:
        """Return the quantities in their units, (n_samples, n_constraints), at q, (n_samples, n_q)."""
        if not self.constraints:
            return np.zeros((q.shape[0], 0))
        return self._values(q)[0]

    def compute_rows(self, q: FloatArray) -> FloatArray:
        """Return rows that are at most zero where the bounds hold, (n_samples, n_rows)."""
        if not self.constraints:
            return np.zeros((q.shape[0], 0))
        return self._rows(q)[0]

    def compute_jacobian(self, q: FloatArray) -> FloatArray:
        """Return the derivatives of the rows by the independent coordinates, (n_samples, n_rows, n_dof)."""
        shape = (q.shape[0], self.owners.size, self.mechanism.n_dof)
        if not self.constraints:
            return np.zeros(shape)
        return self._jacobian(q)[0].reshape(shape)


def _express_measure(joints: list[JointMotion], q: ca.SX, constraint: Constraint) -> ca.SX:
    """Return a smooth function of the quantity: the cosine of an angle, the square of a distance."""
    bodies, vectors = constraint.bodies, constraint.vectors
    if constraint.kind == "coordinate":
        return q[bodies[0]]
    if constraint.kind == "angle":
        a, b = (
            transform_direction(joints, body, vector / np.linalg.norm(vector))
            for body, vector in zip(bodies, vectors, strict=True)
        )
        return dot(a, b)
    if constraint.kind == "singularity":
        return ca.SX(0)
    if constraint.kind == "clearance":
        return _express_nearest(joints, constraint)
    if constraint.kind == "above-plane":
        return _express_lowest(joints, constraint)
    start = transform_point(joints, bodies[1], vectors[1])
    end = transform_point(joints, bodies[0], vectors[0])
    gap = subtract(end, start)
    if constraint.kind == "distance":
        return dot(gap, gap)
    axis = vectors[2] / np.linalg.norm(vectors[2])
    across = cross(transform_direction(joints, bodies[1], axis), gap)
    return dot(across, across)


def _express_nearest(joints: list[JointMotion], constraint: Constraint) -> ca.SX:
    """Return a smooth minimum over pairs of spheres of their squared distances, scaled to 1 where the distance is just
    allowed.
    """
    (a, b), (points_a, radii_a, points_b, radii_b) = constraint.bodies, constraint.vectors
    ends_a, ends_b = (
        [transform_point(joints, body, point) for point in points]
        for body, points in ((a, points_a), (b, points_b))
    )
    shares = [
        _square_length(subtract(p, q)) / (r + s + constraint.lower) ** 2
        for p, r in zip(ends_a, radii_a.tolist(), strict=True)
        for q, s in zip(ends_b, radii_b.tolist(), strict=True)
    ]
    return _express_smooth_minimum(shares)


def _express_lowest(joints: list[JointMotion], constraint: Constraint) -> ca.SX:
    """Return a smooth minimum of the heights of a body's spheres above a plane beyond the gap, in units of
    :data:`_NEAR`.
    """
    points, radii, (foot, normal) = constraint.vectors
    heights = []
    for point, radius in zip(points, radii.tolist(), strict=True):
        centre = transform_point(joints, constraint.bodies[0], point)
        height = sum(
            n * (c - f) for n, c, f in zip(normal.tolist(), centre, foot.tolist(), strict=True)
        )
        heights.append((height - radius - constraint.lower) / _NEAR)
    return _express_smooth_minimum(heights)


def _square_length(vector: Vector) -> ca.SX:
    return dot(vector, vector)


def _express_smooth_minimum(values: list[ca.SX]) -> ca.SX:
    """Return a smooth minimum, which is never above the smallest value."""
    if len(values) == 1:
        return values[0]
    least = ca.mmin(ca.vertcat(*values))
    return least - ca.log(sum(ca.exp(_SHARP * (least - value)) for value in values)) / _SHARP


def _express_quantity(measure: ca.MX, constraint: Constraint) -> ca.MX:
    """Return the quantity in its unit."""
    if constraint.kind == "angle":
        return ca.acos(ca.fmin(ca.fmax(measure, -1), 1))
    if constraint.kind == "clearance":
        touching = constraint.vectors[1].max() + constraint.vectors[3].max()
        return ca.sqrt(ca.fmax(measure, 0)) * (touching + constraint.lower) - touching
    if constraint.kind == "above-plane":
        return measure * _NEAR + constraint.lower
    return ca.sqrt(measure) if constraint.kind in DISTANCES else measure


def _express_rows(measure: ca.MX, constraint: Constraint) -> list[ca.MX]:
    """Return the rows of a constraint's bounds."""
    upper, lower = constraint.upper, constraint.lower
    has_upper, has_lower = upper < np.inf, lower > -np.inf
    if constraint.kind == "angle":
        over, under = ca.cos(upper) - measure, measure - ca.cos(lower)
    elif constraint.kind in DISTANCES:
        over = measure / upper**2 - 1
        under = 1 - measure / lower**2
    elif constraint.kind == "singularity":
        over, under = measure, 1 - measure / lower
    elif constraint.kind == "clearance":
        over, under = measure, 1 - measure
    elif constraint.kind == "above-plane":
        over, under = measure, -measure
    else:
        span = upper - lower if has_upper and has_lower else 1.0
        over, under = (measure - upper) / span, (lower - measure) / span
    return [over] * has_upper + [under] * has_lower
