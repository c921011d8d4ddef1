"""Uncertainty of predicted torques on motions unlike the recorded ones.

A motion that leaves joints at rest, or moves them in unison, may be predicted well by parameters that are wrong for all others.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from paramreduce_cli.identification.estimation import LinearFit
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.random_states import draw_states
from paramreduce_cli.records import FloatArray, IntArray
from paramreduce_cli.texts import format_percent

_STATES = 200
_UNCERTAIN = 0.2
"""Uncertainty of the torques of all joints together from which a hint is given; usual logs leave 0.01 to 0.06."""
_UNKNOWN = 1.0
"""Uncertainty of the torques of a joint from which it is named; usual logs leave up to 0.4."""
_MOST_NAMED = 3


def compute_uncertainty(
    dynamics: Dynamics, columns: IntArray, fit: LinearFit
) -> tuple[FloatArray, FloatArray]:
    """Return the uncertainty of torques on random states, with speeds and accelerations of about one.

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


def hint_at_motion(
    deviations: FloatArray, sizes: FloatArray, fit: LinearFit, names: Sequence[str]
) -> Iterator[str]:
    """Yield a hint if the recorded motion does not tell the torques of other motions.

    Args:
        deviations: Standard deviations of torques on random states, (n_dof,).
        sizes: Sizes of these torques, (n_dof,).
        fit: Fit of all base parameters.
        names: Names of the independent coordinates.
    """
    measured = np.isfinite(fit.deviation)
    size = max(float(np.linalg.norm(sizes[measured])), 1e-300)
    whole = float(np.linalg.norm(deviations[measured])) / size
    shares = np.where(measured, deviations / np.maximum(sizes, 1e-300), 0.0)
    worst = [int(j) for j in np.argsort(-shares)[:_MOST_NAMED] if shares[j] > _UNKNOWN]
    if whole <= _UNCERTAIN and not worst:
        return
    named = ", ".join(names[j] for j in worst)
    yield (
        f"Trust torques of all base parameters on motions like the recorded one only: on random motions of all joints the noise leaves "
        f"them uncertain by {format_percent(whole)}{f', most at {named}' if worst else ''}. Record a motion in which all "
        "joints move, fast and not in unison."
    )
