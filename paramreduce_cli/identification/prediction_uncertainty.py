"""Uncertainty of predicted torques on motions unlike the recorded ones.

A motion that leaves joints at rest, or moves them in unison, may be predicted well by parameters that are wrong for all others.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from paramreduce_cli.identification.estimation import LinearFit
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.random_states import draw_states
from paramreduce_cli.records import BoolArray, FloatArray, IntArray
from paramreduce_cli.texts import format_percent

_STATES = 200
_UNCERTAIN = 0.2
"""Uncertainty of the torques of all joints together from which a hint is given; usual logs leave 0.01 to 0.06."""
_UNKNOWN = 1.0
"""Uncertainty of the torques of a joint from which it is named; usual logs leave up to 0.4."""
_LEAST_SIZE = 1e-3
"""Size of a joint's torques, relative to the largest, from which its uncertainty counts."""
_MOST_NAMED = 3


def compute_torque_uncertainty(
    dynamics: Dynamics, columns: IntArray, fit: LinearFit
) -> tuple[FloatArray, FloatArray]:
    """Return the uncertainty of predicted torques on random states, with speeds and accelerations of about one.

    Args:
        dynamics: Dynamics of the robot.
        columns: Columns of the base parameters.
        fit: Fit of all base parameters.

    Returns:
        Root mean squares of the standard deviations and of the torques, N m or N, (n_dof,) each.
    """
    states = draw_states(dynamics.mechanism, _STATES, np.random.default_rng(0))
    K = dynamics.compute_regressor(*states)[:, :, columns]
    variance = np.mean(np.sum((K @ fit.compute_covariance()) * K, axis=2), axis=0)
    sizes = np.sqrt(np.mean((K @ fit.parameters) ** 2, axis=0))
    return np.sqrt(np.maximum(variance, 0.0)), sizes


def hint_at_undetermined_torques(
    deviations: FloatArray, sizes: FloatArray, measured: BoolArray, names: Sequence[str]
) -> Iterator[str]:
    """Yield a hint if the recorded motion does not determine the torques of other motions.

    Args:
        deviations: Standard deviations of torques on random states, (n_dof,).
        sizes: Sizes of these torques, (n_dof,).
        measured: Whether the torques of each joint are measured, (n_dof,).
        names: Names of the independent coordinates.
    """
    largest = sizes[measured].max(initial=0.0)
    if not largest > 0:
        return
    whole = float(np.linalg.norm(deviations[measured]) / np.linalg.norm(sizes[measured]))
    ratios = np.where(measured, deviations / np.maximum(sizes, _LEAST_SIZE * largest), 0.0)
    worst = [int(j) for j in np.argsort(-ratios)[:_MOST_NAMED] if ratios[j] > _UNKNOWN]
    if worst or whole > _UNCERTAIN:
        listed = ", ".join(f"{names[j]} {format_percent(float(ratios[j]))}" for j in worst)
        yield (
            "The recorded motion does not determine the torques of other motions. On random motions of all joints their standard "
            f"deviation is {format_percent(whole)}{f' ({listed})' if worst else ''}. Record a motion in which all joints move, fast and "
            "not in unison."
        )
