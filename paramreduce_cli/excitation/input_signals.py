"""Signals of time with exact derivatives, that coordinates are moved by or forces are made of."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy  # whose interpolate is loaded when it is used

from paramreduce_cli.records import FloatArray

Rates = tuple[FloatArray, FloatArray, FloatArray]
"""Values of several signals, and their first and second derivatives, (n_signals,) each."""


class Signals(Protocol):
    """Several signals of time."""

    def __call__(self, time: float) -> Rates:
        """Return the signals and their derivatives at a time, s."""


@dataclass(frozen=True)
class Harmonics:
    """Sums of sines that share their frequencies."""

    omega: FloatArray
    """Angular frequencies, (n,), rad/s."""
    waves: FloatArray
    """Complex amplitudes, (n_signals, n): signal i is the imaginary part of the sum of waves[i] exp(j omega t)."""

    def __call__(self, time: float) -> Rates:
        """Return the signals and their derivatives at a time, s."""
        turned = np.exp(1j * self.omega * time)
        value, rate, acceleration = self._bases @ turned
        return value.imag, rate.imag, acceleration.imag

    @cached_property
    def _bases(self) -> FloatArray:
        """Complex amplitudes of the signals and of their derivatives, (3, n_signals, n)."""
        factor = 1j * self.omega
        return np.stack([self.waves, factor * self.waves, factor**2 * self.waves])


class Interpolated:
    """Signals through given values, as cubic splines.

    Args:
        time: Times, ascending, (n_points,), s.
        values: Values, (n_points, n_signals).
    """

    def __init__(self, time: FloatArray, values: FloatArray) -> None:
        spline = scipy.interpolate.CubicSpline(time, values)
        self._derivatives = [spline, spline.derivative(), spline.derivative(2)]

    def __call__(self, time: float) -> Rates:
        """Return the signals and their derivatives at a time, s."""
        value, rate, acceleration = (function(time) for function in self._derivatives)
        return value, rate, acceleration


class Joined:
    """All signals of several groups, one group after the other."""

    def __init__(self, groups: Sequence[Signals]) -> None:
        self._groups = groups

    def __call__(self, time: float) -> Rates:
        """Return the signals and their derivatives at a time, s."""
        parts = [group(time) for group in self._groups]
        if not parts:
            return np.empty(0), np.empty(0), np.empty(0)
        value, rate, acceleration = (np.concatenate(some) for some in zip(*parts, strict=True))
        return value, rate, acceleration
