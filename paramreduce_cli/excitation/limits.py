"""Joint limits that series meet by construction instead of by constraints.

Free harmonics P are mapped to admissible ones p = P / g(P), where g is a smooth maximum of the
shares of the limits that their motion uses on the grid:

* *gauge*: p = P / g(P); every joint uses its range.
* *ball*: p = P / (1 + g(P)^k)^(1/k); joints may stay inside.

Limits are tightened by the grid's margin, so that they hold between its points too.
"""

from collections.abc import Callable
from typing import Literal

import numpy as np

from paramreduce_cli.excitation.fourier import FourierBasis, compute_grid_margin
from paramreduce_cli.records import FloatArray, JointLimits

LimitMapping = Literal["gauge", "ball"]
_BALL_POWER = 20
_FURTHEST = 0.999
"""Share of the position range at which a joint may rest; at the limit itself nothing could move."""


class LimitMap:
    """The map from free to admissible series on one grid.

    A free series is an offset and harmonics. The harmonics are scaled to their limits separately, so that no joint can
    reach a limit by standing still near it; the offset moves within the remaining range.

    Args:
        limits: Limits of all joints.
        basis: The series on an equidistant grid over one period.
        mapping: ``gauge`` or ``ball``.
        rest_to_rest: Whether motions begin and end without velocity and acceleration: two linear
            conditions on the harmonics of each joint, onto which free ones are projected.
    """

    def __init__(
        self,
        limits: JointLimits,
        basis: FourierBasis,
        mapping: LimitMapping,
        *,
        rest_to_rest: bool = False,
    ) -> None:
        points, columns = basis.position.shape
        self.n_dof = limits.middle.size
        self.n_columns = columns
        self.margin = compute_grid_margin((columns - 1) // 2, points)
        self._mapping = mapping
        self._projection = np.eye(columns - 1)
        if rest_to_rest:
            ends = np.vstack([basis.velocity[0, 1:], basis.acceleration[0, 1:]])
            self._projection -= np.linalg.pinv(ends) @ ends
        self._middle, self._reach = limits.middle, limits.reach
        self._positions = _divide_by_limits(basis.position, limits.reach * self.margin)
        speeds = _divide_by_limits(basis.velocity, limits.velocity * self.margin)
        accelerations = _divide_by_limits(basis.acceleration, limits.acceleration * self.margin)
        self._rates = np.concatenate([speeds, accelerations], axis=1)

    def compute_ratios(self, free: FloatArray) -> FloatArray:
        """Return the largest fraction of a limit that each joint's motion uses on the grid, (n_dof,)."""
        up, down, rate = self._compute_extremes(free[:, 1:] @ self._projection)
        return np.maximum((up + down) / 2, rate)

    def scale_to_limits(self, free: FloatArray) -> FloatArray:
        """Return the series scaled so that its motion reaches a limit exactly, or stays inside for the ball mapping."""
        fraction = self.compute_ratios(free)
        if self._mapping == "ball":
            fraction = np.maximum(fraction, 1.0)
        harmonics = free[:, 1:] @ self._projection / fraction[:, None]
        up, down, _ = self._compute_extremes(harmonics)
        return self._insert_offset(free[:, 0], harmonics, up, down)

    def map_to_admissible(
        self, free: FloatArray, norm: float
    ) -> tuple[FloatArray, Callable[[FloatArray], FloatArray]]:
        """Return admissible coefficients, and a function that maps derivatives back to the free ones.

        Args:
            free: Offset and harmonics of each joint, (n_dof, 1 + 2 harmonics).
            norm: Exponent of the smooth maxima; they are never below the true ones.
        """
        offset, harmonics = free[:, 0], free[:, 1:] @ self._projection
        position = _apply_map(self._positions, harmonics)
        rates = _apply_map(self._rates, harmonics)
        up, up_slope = _compute_smooth_maximum(np.maximum(position, 0.0), self._positions, norm)
        down, down_slope = _compute_smooth_maximum(
            np.maximum(-position, 0.0), -self._positions, norm
        )
        rate, rate_slope = _compute_smooth_maximum(np.abs(rates), self._rates, norm, np.sign(rates))
        span, span_slope = (up + down) / 2, (up_slope + down_slope) / 2
        g = np.maximum(span, rate) * (
            (span / np.maximum(span, rate)) ** norm + (rate / np.maximum(span, rate)) ** norm
        ) ** (1 / norm)
        g_slope = _scale_rows((span / g) ** (norm - 1), span_slope)
        g_slope += _scale_rows((rate / g) ** (norm - 1), rate_slope)
        divisor, slope = g, np.ones_like(g)
        if self._mapping == "ball":
            divisor = (1 + g**_BALL_POWER) ** (1 / _BALL_POWER)
            slope = (g / divisor) ** (_BALL_POWER - 1)
        room = 1 - span / divisor

        def pull_back(bar: FloatArray) -> FloatArray:
            """Return the derivative with respect to the free series, given that with respect to the coefficients."""
            centre_bar = bar[:, 0] * self._reach * self.margin
            room_bar = centre_bar * _squash(offset)
            # Harmonics, centre and room all divide by the same number.
            along = np.sum(bar[:, 1:] * harmonics, axis=1)
            along = along + centre_bar * (down - up) / 2 - room_bar * span
            result = np.empty_like(free)
            result[:, 0] = centre_bar * room * (1 + offset**2) ** -1.5
            result[:, 1:] = _scale_rows(1 / divisor, bar[:, 1:])
            result[:, 1:] -= _scale_rows(along * slope / divisor**2, g_slope)
            result[:, 1:] += _scale_rows(centre_bar / (2 * divisor), down_slope - up_slope)
            result[:, 1:] -= _scale_rows(room_bar / divisor, span_slope)
            result[:, 1:] = result[:, 1:] @ self._projection  # which is symmetric
            return result

        harmonics_in = harmonics / divisor[:, None]
        return self._insert_offset(offset, harmonics_in, up / divisor, down / divisor), pull_back

    def compute_resting_offset(self, z: FloatArray) -> FloatArray:
        """Return the free offsets of joints that rest at ``z``, both (n_dof,)."""
        fraction = (z - self._middle) / (self._reach * self.margin)
        fraction = np.clip(fraction, -_FURTHEST, _FURTHEST)
        return fraction / np.sqrt(1 - fraction**2)

    def _compute_extremes(self, harmonics: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the largest fractions of the limits that harmonics use, (n_dof,) each: of half the position range
        upwards and downwards, and of the rates.
        """
        position = _apply_map(self._positions, harmonics)
        rate = np.abs(_apply_map(self._rates, harmonics)).max(axis=1)
        up, down = position.max(axis=1), -position.min(axis=1)
        return np.maximum(up, 0.0), np.maximum(down, 0.0), rate

    def _insert_offset(
        self, offset: FloatArray, harmonics: FloatArray, up: FloatArray, down: FloatArray
    ) -> FloatArray:
        """Return the harmonics with an offset that keeps the motion in its range, for any free offset."""
        centre, room = (down - up) / 2, 1 - (up + down) / 2
        fraction = centre + room * _squash(offset)
        return np.column_stack([self._middle + self._reach * self.margin * fraction, harmonics])


def _divide_by_limits(motion: FloatArray, limits: FloatArray) -> FloatArray:
    """Return the linear maps from harmonics to fractions of each joint's limit, (n_dof, n_points, 2 harmonics)."""
    shares: FloatArray = motion[None, :, 1:] / limits[:, None, None]
    return shares


def _apply_map(coefficients: FloatArray, harmonics: FloatArray) -> FloatArray:
    """Return the harmonics after a linear map of each joint."""
    used: FloatArray = (coefficients @ harmonics[:, :, None])[:, :, 0]
    return used


def _scale_rows(factors: FloatArray, rows: FloatArray) -> FloatArray:
    """Return each row multiplied by its joint's factor."""
    return factors[:, None] * rows


def _squash(offset: FloatArray) -> FloatArray:
    """Return any number mapped to the interval from -1 to 1."""
    return offset / np.sqrt(1 + offset**2)


def _compute_smooth_maximum(
    used: FloatArray, fractions: FloatArray, norm: float, signs: FloatArray | float = 1.0
) -> tuple[FloatArray, FloatArray]:
    """Return a smooth maximum over time of magnitudes, (n_dof,), and its derivative with respect to the harmonics.

    Args:
        used: Magnitudes, (n_dof, n_points).
        fractions: Harmonics to what ``used`` is the magnitude of, (n_dof, n_points, 2 harmonics).
        norm: The exponent.
        signs: Signs of the values whose magnitudes are ``used``.
    """
    largest = np.maximum(used.max(axis=1, keepdims=True), np.finfo(float).tiny)
    ratio = used / largest
    power = ratio ** (norm - 1)
    total = np.sum(power * ratio, axis=1, keepdims=True)
    weight = signs * power * total ** (1 / norm - 1)
    return (largest * total ** (1 / norm))[:, 0], (weight[:, None, :] @ fractions)[:, 0, :]
