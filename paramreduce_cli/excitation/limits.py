"""Joint limits, met by construction instead of by constraints.

Free harmonics P are mapped to admissible ones p = P / g(P), where g is a smooth maximum of the
shares of the limits that their motion uses on the grid:

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

    A free series is an offset and harmonics. The harmonics are scaled to their limits by
    themselves, so that no joint can meet its limit by being parked there; the offset moves
    within the room that is left.

    Args:
        limits: Of all joints.
        basis: The series on an equidistant grid over one period.
        mapping: ``gauge`` or ``ball``.
    """

    def __init__(self, limits: JointLimits, basis: FourierBasis, mapping: Mapping) -> None:
        points, columns = basis.position.shape
        self.n_dof = limits.middle.size
        self.n_columns = columns
        self._points = points
        self._margin = grid_margin((columns - 1) // 2, points)
        self._mapping = mapping
        self._middle, self._reach = limits.middle, limits.reach
        sizes = (limits.reach, limits.velocity, limits.acceleration)
        motions = (basis.position, basis.velocity, basis.acceleration)
        self._shares = np.stack(
            [
                np.vstack(
                    [m[:, 1:] / (s[j] * self._margin) for m, s in zip(motions, sizes, strict=True)]
                )
                for j in range(self.n_dof)
            ]
        )
        """Harmonics to shares of the limits, positions first, (n_dof, 3 n_points, 2 harmonics)."""

    def shares(self, free: FloatArray) -> FloatArray:
        """Largest share of a limit that each joint's motion uses on the grid, (n_dof,)."""
        return np.abs(self._used(free[:, 1:])).max(axis=1)

    def scaled(self, free: FloatArray) -> FloatArray:
        """Series whose motion reaches a limit exactly, or stays inside for the ball."""
        share = self.shares(free)
        if self._mapping == "ball":
            share = np.maximum(share, 1.0)
        harmonics = free[:, 1:] / share[:, None]
        excursion = np.abs(self._used(harmonics)[:, : self._points]).max(axis=1)
        return self._with_offset(free[:, 0], harmonics, 1 - excursion)

    def admissible(self, free: FloatArray, norm: float) -> tuple[FloatArray, Pullback]:
        """Admissible coefficients, and how a derivative by them is pulled back.

        Args:
            free: Offset and harmonics of each joint, (n_dof, 1 + 2 harmonics).
            norm: Exponent of the smooth maximum; it is never below the true maximum.
        """
        offset, harmonics = free[:, 0], free[:, 1:]
        used = self._used(harmonics)
        g, g_slope = _smooth_maximum(used, self._shares, norm)
        positions = slice(0, self._points)
        e, e_slope = _smooth_maximum(used[:, positions], self._shares[:, positions], norm)
        divisor, slope = g, np.ones_like(g)
        if self._mapping == "ball":
            divisor = (1 + g**_BALL_POWER) ** (1 / _BALL_POWER)
            slope = (g / divisor) ** (_BALL_POWER - 1)
        room = 1 - e / divisor
        half = self._reach * self._margin

        def pull(bar: FloatArray) -> FloatArray:
            offset_bar = bar[:, 0] * half
            room_bar = offset_bar * _squashed(offset)
            # Both the scaled harmonics and the room divide by the same number.
            along = np.sum(bar[:, 1:] * harmonics, axis=1) - room_bar * e
            result = np.empty_like(free)
            result[:, 0] = offset_bar * room * (1 + offset**2) ** -1.5
            result[:, 1:] = (
                bar[:, 1:] / divisor[:, None]
                - (along * slope / divisor**2)[:, None] * g_slope
                - (room_bar / divisor)[:, None] * e_slope
            )
            return result

        return self._with_offset(offset, harmonics / divisor[:, None], room), pull

    def _used(self, harmonics: FloatArray) -> FloatArray:
        used: FloatArray = (self._shares @ harmonics[:, :, None])[:, :, 0]
        return used

    def _with_offset(
        self, offset: FloatArray, harmonics: FloatArray, room: FloatArray
    ) -> FloatArray:
        moved = self._middle + self._reach * self._margin * room * _squashed(offset)
        return np.column_stack([moved, harmonics])


def _squashed(offset: FloatArray) -> FloatArray:
    """Any number to one between -1 and 1."""
    return offset / np.sqrt(1 + offset**2)


def _smooth_maximum(
    used: FloatArray, shares: FloatArray, norm: float
) -> tuple[FloatArray, FloatArray]:
    """The norm of each row, (n_dof,), and its derivative by the harmonics."""
    largest = np.maximum(np.abs(used).max(axis=1, keepdims=True), np.finfo(float).tiny)
    ratio = np.abs(used) / largest
    power = ratio ** (norm - 1)
    total = np.sum(power * ratio, axis=1, keepdims=True)
    weight = np.copysign(power, used) * total ** (1 / norm - 1)
    slope = (weight[:, None, :] @ shares)[:, 0, :]
    return (largest * total ** (1 / norm))[:, 0], slope
