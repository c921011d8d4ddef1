"""Computed-torque control in simulation, of many paths at once.

The torques tau = d(z, dz, ddz_d + 2 w (dz_d - dz) + w^2 (z_d - z)) come from the controller's model
and are held for a control period; the arm follows the full one.
"""

from collections.abc import Callable

import numpy as np

from paramreduce_cli.records import FloatArray, Paths

_STEPS = 2
"""Of the arm's integrator in a control period."""

Torque = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""Torques for z, dz and ddz, (n_paths, n_dof) each."""


def simulate(paths: Paths, model: Torque, arm: Torque, bandwidth: float) -> FloatArray:
    """Follow paths with computed torques.

    Args:
        paths: The motions that are wanted.
        model: Of the controller.
        arm: Accelerations of the arm at z and dz under torques.
        bandwidth: Of the feedback, rad/s.

    Returns:
        z_d - z, (n_samples, n_paths, n_dof).
    """
    step = float(paths.time[1] - paths.time[0]) / _STEPS
    z, dz = paths.z[0].copy(), paths.dz[0].copy()
    errors = np.empty_like(paths.z)
    for k in range(paths.time.size):
        errors[k] = paths.z[k] - z
        wanted = paths.ddz[k] + 2 * bandwidth * (paths.dz[k] - dz) + bandwidth**2 * errors[k]
        tau = model(z, dz, wanted)
        for _ in range(_STEPS):
            z, dz = _runge_kutta(z, dz, tau, arm, step)
    return errors


def _runge_kutta(
    z: FloatArray, dz: FloatArray, tau: FloatArray, arm: Torque, h: float
) -> tuple[FloatArray, FloatArray]:
    a1 = arm(z, dz, tau)
    v2 = dz + h / 2 * a1
    a2 = arm(z + h / 2 * dz, v2, tau)
    v3 = dz + h / 2 * a2
    a3 = arm(z + h / 2 * v2, v3, tau)
    v4 = dz + h * a3
    a4 = arm(z + h * v3, v4, tau)
    return z + h / 6 * (dz + 2 * v2 + 2 * v3 + v4), dz + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
