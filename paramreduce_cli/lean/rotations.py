"""Turns of vectors and inertias: by a joint's angle about z, and by constant rotations."""

from dataclasses import dataclass

import numpy as np

from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.expressions.vectors import Vector
from paramreduce_cli.lean.algebra import Scalar, cache_expressions
from paramreduce_cli.lean.inertia_expressions import Inertia
from paramreduce_cli.records import FloatArray
from paramreduce_cli.robots.frames import count_right_angles

_SLIGHT = 1e-3
"""Sine of a tilt below which rounding would show in the angles of the turns before and after it."""


@dataclass(frozen=True)
class JointRotation:
    """A rotation about z; ``cosine`` and ``sine`` are expressions or exact constants."""

    cosine: Scalar
    sine: Scalar

    def to_parent(self, a: Vector) -> Vector:
        """Return a vector's components in the parent's frame, Rz a, from those in the rotated frame."""
        c, s = self.cosine, self.sine
        return (c * a[0] - s * a[1], s * a[0] + c * a[1], a[2])

    def to_child(self, a: Vector) -> Vector:
        """Return a vector's components in the rotated frame, Rz' a, from those in the parent's frame."""
        c, s = self.cosine, self.sine
        return (c * a[0] + s * a[1], c * a[1] - s * a[0], a[2])

    @cache_expressions
    def rotate_inertia(self, body: Inertia) -> Inertia:
        """Return the inertia in the frame before the rotation: Rz I Rz' and the rotated first moments.

        The xx-yy-xy block rotates by the double angle: with w = s (Ixx - Iyy) + 2 c Ixy, xx becomes Ixx - s w, yy
        becomes Iyy + s w, and xy becomes c w - Ixy.
        """
        c, s = self.cosine, self.sine
        xz, yz, _ = self.to_parent((body.xz, body.yz, body.zz))
        if c.graph.number(c.value) == 0.0:
            xx, yy, xy = body.yy, body.xx, -body.xy
        elif not s:
            xx, yy, xy = body.xx, body.yy, body.xy
        else:
            w = s * (body.xx - body.yy) + c * (2 * body.xy)
            moved = s * w
            xx, yy, xy = body.xx - moved, body.yy + moved, c * w - body.xy
        return Inertia(body.m, self.to_parent(body.d), xx, xy, xz, yy, yz, body.zz)


def make_joint_rotation(angle: Scalar, offset: float) -> JointRotation:
    """Return the rotation by angle + offset; whole multiples of 90 degrees cost nothing and are exact."""
    quarters = count_right_angles(offset)
    if quarters is None:
        angle, quarters = angle + offset, 0
    c, s = angle.take_cosine(), angle.take_sine()
    for _ in range(quarters % 4):
        c, s = -s, c
    return JointRotation(c, s)


class ConstantRotation:
    """A constant rotation, C = Rz Rx Rz by angles of which most are quarter turns.

    Args:
        graph: Graph of the expressions.
        rotation: Rotation matrix, (3, 3).
    """

    def __init__(self, graph: Graph, rotation: FloatArray) -> None:
        self._rows = [[float(x) for x in row] for row in rotation]
        self._columns = [[float(x) for x in row] for row in rotation.T]
        self._turns = [
            JointRotation(*(Scalar(graph, graph.constant(x)) for x in cs))
            for cs in _find_euler_angles(rotation)
        ]
        self.is_permutation = bool(np.all((rotation == 0) | (np.abs(rotation) == 1)))
        self._slight = 0 < float(np.hypot(rotation[2, 0], rotation[2, 1])) < _SLIGHT

    @cache_expressions
    def to_parent(self, a: Vector) -> Vector:
        """Return C a."""
        if self.is_permutation or self._slight:
            return _multiply_rows(self._rows, a)
        first, middle, last = self._turns
        return last.to_parent(_cycle(middle.to_parent(_uncycle(first.to_parent(a)))))

    @cache_expressions
    def to_child(self, a: Vector) -> Vector:
        """Return C' a."""
        if self.is_permutation or self._slight:
            return _multiply_rows(self._columns, a)
        first, middle, last = self._turns
        return first.to_child(_cycle(middle.to_child(_uncycle(last.to_child(a)))))

    @cache_expressions
    def rotate_inertia(self, body: Inertia) -> Inertia:
        """Return C I C', with the first moments."""
        if self._slight:
            return self._multiply_inertia(body)
        first, middle, last = self._turns
        turned = last.rotate_inertia(
            middle.rotate_inertia(first.rotate_inertia(body).cycle_axes()).cycle_axes().cycle_axes()
        )
        return turned.replace_first_moments(self.to_parent(body.d))

    def _multiply_inertia(self, body: Inertia) -> Inertia:
        """Return C I C' as a product of matrices, without the angles of C."""
        tensor: list[Vector] = [
            (body.xx, body.xy, body.xz),
            (body.xy, body.yy, body.yz),
            (body.xz, body.yz, body.zz),
        ]
        half = [self.to_parent(row) for row in tensor]
        x, y, z = (self.to_parent((half[0][k], half[1][k], half[2][k])) for k in range(3))
        return Inertia(body.m, self.to_parent(body.d), x[0], x[1], x[2], y[1], y[2], z[2])

    def find_permutation(self) -> list[tuple[int, int]]:
        """Return, for each axis before a permutation C, the axis of C's columns that it is, and its sign."""
        return [
            next((k, int(x)) for k, x in enumerate(column) if x != 0) for column in self._columns
        ]


@cache_expressions
def make_constant_rotation(graph: Graph, rotation: bytes) -> ConstantRotation:
    """Return the rotation whose matrix is given by its bytes."""
    return ConstantRotation(graph, np.frombuffer(rotation).reshape(3, 3))


def _find_euler_angles(rotation: FloatArray) -> list[tuple[float, float]]:
    """Return cosines and sines of b, a, g with rotation = Rz(g) Rx(a) Rz(b)."""
    cosine = float(rotation[2, 2])
    sine = float(np.hypot(rotation[2, 0], rotation[2, 1]))
    if sine == 0.0:
        return [(float(rotation[0, 0]), cosine * float(rotation[1, 0])), (cosine, 0.0), (1.0, 0.0)]
    first = (float(rotation[2, 1]) / sine, float(rotation[2, 0]) / sine)
    last = (-float(rotation[1, 2]) / sine, float(rotation[0, 2]) / sine)
    return [first, (cosine, sine), last]


def _uncycle(a: Vector) -> Vector:
    """Return the components with x in the place of z."""
    return (a[1], a[2], a[0])


def _cycle(a: Vector) -> Vector:
    return (a[2], a[0], a[1])


def _multiply_rows(rows: list[list[float]], a: Vector) -> Vector:
    """Return the product of a constant matrix and a vector."""
    x, y, z = (row[0] * a[0] + row[1] * a[1] + row[2] * a[2] for row in rows)
    return (x, y, z)
