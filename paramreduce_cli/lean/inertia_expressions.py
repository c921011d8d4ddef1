"""The inertia of a body, or of several that move as one, as expressions.

Linear in the standard parameters: mass, first moments d = m r and the tensor about a point.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from paramreduce_cli.expressions.vectors import Vector, add, scale
from paramreduce_cli.lean.algebra import Scalar, cache_expressions


@dataclass(frozen=True)
class Inertia:
    """The mass, first moments and inertia tensor of a body about one point, in one frame."""

    m: Scalar
    d: Vector
    xx: Scalar
    xy: Scalar
    xz: Scalar
    yy: Scalar
    yz: Scalar
    zz: Scalar

    @cache_expressions
    def __add__(self, other: Inertia) -> Inertia:
        return Inertia(
            self.m + other.m,
            add(self.d, other.d),
            self.xx + other.xx,
            self.xy + other.xy,
            self.xz + other.xz,
            self.yy + other.yy,
            self.yz + other.yz,
            self.zz + other.zz,
        )

    def __bool__(self) -> bool:
        """Whether anything in it is not zero."""
        tensor = (self.xx, self.xy, self.xz, self.yy, self.yz, self.zz)
        return any(bool(value) for value in (self.m, *self.d, *tensor))

    @cache_expressions
    def move_point(self, r: Vector) -> Inertia:
        """Return the inertia about another point; r leads from the new point to the present one.

        The theorem of parallel axes: with the first moments h before and h' = h + m r after, the tensor gains
        (r . (h + h')) 1 - (r h' + h' r') with one h and one h', which is symmetric.
        """
        old = self.d
        new = add(old, scale(self.m, r))
        px, py, pz = (r[k] * (old[k] + new[k]) for k in range(3))

        def product(i: int, j: int) -> Scalar:
            return r[i] * old[j] + new[i] * r[j]

        return Inertia(
            self.m,
            new,
            self.xx + (py + pz),
            self.xy - product(0, 1),
            self.xz - product(0, 2),
            self.yy + (px + pz),
            self.yz - product(1, 2),
            self.zz + (px + py),
        )

    def cycle_axes(self) -> Inertia:
        """Return the inertia after renaming the axes: x becomes z, y becomes x and z becomes y."""
        x, y, z = self.d
        return Inertia(self.m, (y, z, x), self.yy, self.yz, self.xy, self.zz, self.xz, self.xx)

    def replace_first_moments(self, d: Vector) -> Inertia:
        """Return the inertia with other first moments."""
        return replace(self, d=d)
