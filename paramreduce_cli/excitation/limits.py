"""Joint limits, met by construction instead of by constraints.

Free series P are mapped to admissible ones p = P / g(P), where g is a smooth maximum of the
shares of the limits that P uses on the grid:

* *gauge*: p = P / g(P); every joint uses its range.
* *ball*: p = P / (1 + g(P)^k)^(1/k); joints may stay inside.

Limits are tightened by the grid's margin, so that they hold between its points too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from paramreduce_cli.excitation.fourier import FourierBasis, grid_margin
from paramreduce_cli.records import FloatArray

Mapping = Literal["gauge", "ball"]
Pullback = Callable[[FloatArray], FloatArray]
_BALL_POWER = 20


@dataclass(frozen=True)
class JointLimits:
    """Limits of every joint; infinite where there is none."""

    lower: FloatArray
    """Positions, (n_dof,), rad or m."""
    upper: FloatArray
    velocity: FloatArray
    """Magnitudes, (n_dof,), rad/s or m/s."""
    acceleration: FloatArray
    """Magnitudes, (n_dof,), rad/s^2 or m/s^2."""

    @property
    def middle(self) -> FloatArray:
        """Of the position range, (n_dof,)."""
        return (self.lower + self.upper) / 2

    @property
    def reach(self) -> FloatArray:
        """Half the position range, (n_dof,)."""
        return (self.upper - self.lower) / 2


class LimitMap:
    """The map from free to admissible series on one grid.

    Args:
        limits: Of all joints.
        basis: The series on an equidistant grid over one period.
        mapping: ``gauge`` or ``ball``.
    """

    def __init__(self, limits: JointLimits, basis: FourierBasis, mapping: Mapping) -> None:
        points, columns = basis.position.shape
        self.harmonics = (columns - 1) // 2
        margin = grid_margin(self.harmonics, points)
        self.mapping = mapping
        self.middle = limits.middle
        self._shares = np.stack(
            [
                np.vstack(
                    [
                        basis.position / (limits.reach[j] * margin),
                        basis.velocity / (limits.velocity[j] * margin),
                        basis.acceleration / (limits.acceleration[j] * margin),
                    ]
                )
                for j in range(limits.middle.size)
            ]
        )

    def shares(self, free: FloatArray) -> FloatArray:
        """Largest share of a limit that each joint's series uses on the grid, (n_dof,)."""
        return np.abs(np.einsum("jpc,jc->jp", self._shares, free)).max(axis=1)

    def scaled(self, free: FloatArray) -> FloatArray:
        """Series that reach their limits exactly, or stay inside for the ball."""
        share = self.shares(free)
        if self.mapping == "ball":
            share = np.maximum(share, 1.0)
        return self._centred(free / share[:, None])

    def admissible(self, free: FloatArray, norm: float) -> tuple[FloatArray, Pullback]:
        """Admissible coefficients, and how a derivative by them is pulled back.

        Args:
            free: Series about the middle of the range, (n_dof, 1 + 2 harmonics).
            norm: Exponent of the smooth maximum; it is never below the true maximum.
        """
        used = np.einsum("jpc,jc->jp", self._shares, free)
        largest = np.abs(used).max(axis=1, keepdims=True)
        ratio = np.abs(used) / largest
        total = np.sum(ratio**norm, axis=1, keepdims=True)
        g = largest * total ** (1 / norm)
        weight = np.sign(used) * ratio ** (norm - 1) * total ** (1 / norm - 1)
        slope = np.einsum("jp,jpc->jc", weight, self._shares)
        if self.mapping == "gauge":
            divisor, derivative = g, np.ones_like(g)
        else:
            divisor = (1 + g**_BALL_POWER) ** (1 / _BALL_POWER)
            derivative = (g / divisor) ** (_BALL_POWER - 1)

        def pull(bar: FloatArray) -> FloatArray:
            along = np.sum(bar * free, axis=1, keepdims=True)
            return bar / divisor - along / divisor**2 * derivative * slope

        return self._centred(free / divisor), pull

    def _centred(self, free: FloatArray) -> FloatArray:
        result = free.copy()
        result[:, 0] += self.middle
        return result
