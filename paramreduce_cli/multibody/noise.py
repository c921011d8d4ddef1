"""Torque noise of each joint, estimated from the residuals of all parameters."""

import numpy as np

from paramreduce_cli.multibody.observation import combine_factors
from paramreduce_cli.multibody.orthogonal import DEPENDENT, solve_least_squares
from paramreduce_cli.records import FloatArray

_ROUNDS = 5
"""Rounds of fits weighted by the noise that the one before has left; it hardly changes after three."""


def compute_residual_rms(factors: FloatArray, parameters: FloatArray, n_samples: int) -> FloatArray:
    """Return the root mean square of each joint's residuals, (n_dof,).

    Args:
        factors: Triangular factors of [W | tau] per trajectory and joint.
        parameters: Parameters of the model, (n,).
        n_samples: Number of samples in all trajectories.
    """
    left = factors[..., -1] - factors[..., :-1] @ parameters
    result: FloatArray = np.sqrt(np.sum(left**2, axis=(0, 2)) / n_samples)
    return result


def estimate_joint_noise(factors: FloatArray, scale: FloatArray, n_samples: int) -> FloatArray:
    """Return the standard deviation of each joint's torque noise, (n_dof,); infinite where no torque is measured.

    The method is iterated weighted least squares on all parameters [Gautier1997], corrected for the degrees of freedom
    of the fit.

    Args:
        factors: Triangular factors of [W | tau] per trajectory and joint.
        scale: First divisor of the torques, (n_dof,); infinite where they are not measured.
        n_samples: Number of samples in all trajectories.
    """
    noise = scale.copy()
    measured = np.isfinite(scale)
    rank = np.linalg.matrix_rank(combine_factors(factors, noise)[:, :-1], rtol=DEPENDENT)
    free = max(0.1, 1 - rank / (n_samples * np.count_nonzero(measured)))
    for _ in range(_ROUNDS):
        parameters = solve_least_squares(combine_factors(factors, noise))
        left = compute_residual_rms(factors, parameters, n_samples) / np.sqrt(free)
        # A joint that is fitted without any residual would take all the weight.
        left = np.maximum(left, 1e-6 * scale)
        noise = np.where(measured, left, np.inf)
    return noise
