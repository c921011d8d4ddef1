"""Computed-torque control in simulation: what a reduced model costs a controller.

The torques tau = d(z, dz, ddz_d + 2 w (dz_d - dz) + w^2 (z_d - z)) come from the controller's model
and are held for a control period; the arm follows the full one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from paramreduce_cli.records import FloatArray

_PEAK_SPEED = 1.875
"""Of a quintic of unit length in unit time."""
_STEPS = 2
"""Of the arm's integrator in a control period."""

Torque = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""Torques for z, dz and ddz, (n_dof,) each."""


@dataclass(frozen=True)
class Path:
    """A motion at the times of the controller; (n_samples, n_dof) each."""

    time: FloatArray
    z: FloatArray
    dz: FloatArray
    ddz: FloatArray


@dataclass(frozen=True)
class Tracking:
    """How well each controller followed a path."""

    path: Path
    errors: dict[str, FloatArray]
    """By the model of the controller: z_d - z, (n_samples, n_dof), rad or m."""
    seconds: dict[str, float]
    """Of one evaluation of the model, s."""
    language: str
    """In which it was evaluated."""


def point_to_point(
    low: FloatArray, high: FloatArray, speed: FloatArray, moves: int, period: float, seed: int
) -> Path:
    """Moves from rest to rest between random poses, quintic in time.

    Args:
        low: Smallest coordinates, (n_dof,), rad or m.
        high: Largest coordinates.
        speed: Largest speeds, (n_dof,).
        moves: Their number.
        period: Of the controller, s.
        seed: Of the poses.
    """
    rng = np.random.default_rng(seed)
    poses = rng.uniform(low, high, size=(moves + 1, low.size))
    parts = []
    for start, end in pairwise(poses):
        step = end - start
        duration = max(float(np.max(_PEAK_SPEED * np.abs(step) / speed)), period)
        s = (np.arange(int(np.ceil(duration / period))) * period / duration)[:, None]
        parts.append(
            (
                start + step * s**3 * (10 - 15 * s + 6 * s**2),
                step / duration * 30 * s**2 * (1 - s) ** 2,
                step / duration**2 * 60 * s * (1 - s) * (1 - 2 * s),
            )
        )
    z, dz, ddz = (np.concatenate(column) for column in zip(*parts, strict=True))
    time = np.arange(z.shape[0], dtype=np.float64) * np.float64(period)
    return Path(time, z, dz, ddz)


def simulate(
    path: Path,
    model: Torque,
    arm: Callable[[FloatArray, FloatArray, FloatArray], FloatArray],
    bandwidth: float,
) -> FloatArray:
    """Follow a path with computed torques.

    Args:
        path: The motion that is wanted.
        model: Of the controller.
        arm: Accelerations of the arm at z and dz under torques.
        bandwidth: Of the feedback, rad/s.

    Returns:
        z_d - z, (n_samples, n_dof).
    """
    step = float(path.time[1] - path.time[0]) / _STEPS
    z, dz = path.z[0].copy(), path.dz[0].copy()
    errors = np.empty_like(path.z)
    for k in range(path.time.size):
        errors[k] = path.z[k] - z
        wanted = path.ddz[k] + 2 * bandwidth * (path.dz[k] - dz) + bandwidth**2 * errors[k]
        tau = model(z, dz, wanted)
        for _ in range(_STEPS):
            z, dz = _runge_kutta(z, dz, tau, arm, step)
    return errors


def _runge_kutta(
    z: FloatArray,
    dz: FloatArray,
    tau: FloatArray,
    arm: Callable[[FloatArray, FloatArray, FloatArray], FloatArray],
    h: float,
) -> tuple[FloatArray, FloatArray]:
    a1 = arm(z, dz, tau)
    v2 = dz + h / 2 * a1
    a2 = arm(z + h / 2 * dz, v2, tau)
    v3 = dz + h / 2 * a2
    a3 = arm(z + h / 2 * v2, v3, tau)
    v4 = dz + h * a3
    a4 = arm(z + h * v3, v4, tau)
    return z + h / 6 * (dz + 2 * v2 + 2 * v3 + v4), dz + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
