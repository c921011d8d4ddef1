"""Finite Fourier series as joint trajectories [Swevers1996].

z(t) = q0 + sum_l a_l / (w l) sin(w l t) - b_l / (w l) cos(w l t), with w = 2 pi / period;
the coefficients of one joint are [q0, a1, b1, a2, b2, ...].
"""

from dataclasses import dataclass

import numpy as np

from paramreduce_cli.records import FloatArray

FINER = 4
"""How much finer than the grid of a trajectory the one is on which bounds are checked in the end."""


@dataclass(frozen=True)
class FourierBasis:
    """A basis of matrices that turn the coefficients of a joint into its motion at given times, (n_points, 1 + 2
    harmonics) each.
    """

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray

    def evaluate(self, coefficients: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the motion of all joints.

        Args:
            coefficients: Coefficients of the series, (n_dof, 1 + 2 harmonics).

        Returns:
            z, dz and ddz, each (n_points, n_dof).
        """
        return (
            self.position @ coefficients.T,
            self.velocity @ coefficients.T,
            self.acceleration @ coefficients.T,
        )


def sample_times(period: float, points: int) -> FloatArray:
    """Return equidistant times over one period without its end, (points,), s."""
    return period * np.arange(points) / points


def evaluate_basis(period: float, harmonics: int, time: FloatArray) -> FourierBasis:
    """Return the functions whose weighted sum is the series, and their derivatives, at given times.

    Args:
        period: Period, s.
        harmonics: Number of harmonics.
        time: Times, (n_points,), s.
    """
    frequency = 2 * np.pi / period * np.arange(1, harmonics + 1)
    phase = np.outer(time, frequency)
    sine, cosine = np.sin(phase), np.cos(phase)
    position = np.ones((time.size, 1 + 2 * harmonics))
    velocity, acceleration = np.zeros_like(position), np.zeros_like(position)
    position[:, 1::2], position[:, 2::2] = sine / frequency, -cosine / frequency
    velocity[:, 1::2], velocity[:, 2::2] = cosine, sine
    acceleration[:, 1::2], acceleration[:, 2::2] = -frequency * sine, frequency * cosine
    return FourierBasis(time, position, velocity, acceleration)


def shift_start(coefficients: FloatArray, period: float, time: float) -> FloatArray:
    """Return the coefficients of the same motion with the clock set to zero at some time, by the addition theorems.

    Args:
        coefficients: Coefficients of the series, (n_dof, 1 + 2 harmonics).
        period: Period, s.
        time: Time that becomes zero, s.
    """
    phase = 2 * np.pi / period * time * np.arange(1, (coefficients.shape[1] + 1) // 2)
    sine, cosine = np.sin(phase), np.cos(phase)
    a, b = coefficients[:, 1::2], coefficients[:, 2::2]
    result = coefficients.copy()
    result[:, 1::2], result[:, 2::2] = a * cosine + b * sine, b * cosine - a * sine
    return result


def compute_grid_margin(harmonics: int, points: int) -> float:
    """Return the factor by which limits must be tightened on a grid to hold between its points too.

    A trigonometric polynomial of degree N exceeds its largest magnitude on M equidistant points of its period by at
    most 1 / cos(pi N / M) [Ehlich1964].

    Raises:
        ValueError: The grid has no more than twice as many points as harmonics.
    """
    if points <= 2 * harmonics:
        raise ValueError(f"{points} points cannot bound {harmonics} harmonics between them")
    return float(np.cos(np.pi * harmonics / points))
