"""Computed-torque control in simulation, of many paths at once.

The torques tau = d(z, dz, ddz_d + 2 w (dz_d - dz) + w^2 (z_d - z)) come from the controller's model
and are held for a control period; the arm follows the full one.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from paramreduce_cli.records import FloatArray, Paths

_STEPS = 2
"""Steps of the arm's integrator in a control period."""

Torque = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""Torques for z, dz and ddz, (n_paths, n_dof) each."""
Arm = Callable[[FloatArray, FloatArray, FloatArray], Sequence[FloatArray]]
"""z and dz a control period later, from z, dz and torques that are held, (n_paths, n_dof) each."""


def simulate(paths: Paths, model: Torque, arm: Arm, bandwidth: float) -> FloatArray:
    """Follow paths with computed torques.

    Args:
        paths: The motions that are wanted.
        model: Model in the controller.
        arm: Arm that is controlled.
        bandwidth: Bandwidth of the feedback, rad/s.

    Returns:
        z_d - z, (n_samples, n_paths, n_dof).
    """
    z, dz = paths.z[0].copy(), paths.dz[0].copy()
    errors = np.empty_like(paths.z)
    for k in range(paths.time.size):
        errors[k] = paths.z[k] - z
        demanded = paths.ddz[k] + 2 * bandwidth * (paths.dz[k] - dz) + bandwidth**2 * errors[k]
        z, dz = arm(z, dz, model(z, dz, demanded))
    return errors


def advance_state(
    accelerations: Callable[[Any, Any, Any], Any], period: float, z: Any, dz: Any, tau: Any
) -> tuple[Any, Any]:
    """Return z and dz a control period later, by Runge-Kutta steps; numbers or symbols.

    Args:
        accelerations: Accelerations of the arm by z, dz and tau.
        period: Control period, s.
        z: Positions.
        dz: Velocities.
        tau: Torques, which are held.
    """
    for _ in range(_STEPS):
        z, dz = _take_runge_kutta_step(z, dz, tau, accelerations, period / _STEPS)
    return z, dz


def _take_runge_kutta_step(
    z: Any, dz: Any, tau: Any, arm: Callable[[Any, Any, Any], Any], h: float
) -> tuple[Any, Any]:
    """Return z and dz a step h later, by the classical method of fourth order."""
    a1 = arm(z, dz, tau)
    v2 = dz + h / 2 * a1
    a2 = arm(z + h / 2 * dz, v2, tau)
    v3 = dz + h / 2 * a2
    a3 = arm(z + h / 2 * v2, v3, tau)
    v4 = dz + h * a3
    a4 = arm(z + h * v3, v4, tau)
    return z + h / 6 * (dz + 2 * v2 + 2 * v3 + v4), dz + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
