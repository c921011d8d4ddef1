"""Least-squares fits of subsets, and the torque errors that they leave."""

from dataclasses import dataclass

import numpy as np

from paramreduce_cli.multibody.orthogonal import DEPENDENT, normalise_columns, select_independent
from paramreduce_cli.records import FloatArray, IntArray
from paramreduce_cli.reduction.problem import SelectionProblem


@dataclass(frozen=True)
class Fit:
    """A least-squares fit of one subset."""

    parameters: FloatArray
    """Approximate base parameters phi'_R, (n,)."""
    torque_error: float
    minimum_norm: bool
    """Whether the columns are dependent, so that the smallest of many solutions was taken."""


def fit(problem: SelectionProblem, subset: IntArray) -> Fit:
    """Fit a subset: phi'_R = W_R^+ chi [Ros2019], Eq. 17.

    Columns are scaled to unit length first. The minimum norm of a dependent subset is therefore that of the torques of
    the parameters, and does not depend on units.
    """
    dependent = len(select_independent(problem.W, subset)) < subset.size
    cut = DEPENDENT if dependent else None
    solution, *_ = np.linalg.lstsq(problem.X[:, subset], problem.chi, rcond=cut)
    parameters = solution / problem.lengths[subset]
    error = compute_relative_error(problem, subset, parameters)
    return Fit(parameters, error, dependent)


def compute_lumping(W: FloatArray, subset: IntArray) -> FloatArray:
    """Return beta = W_R^+ W_E [Ros2019], Eq. 20: what the columns of a subset take over from the other ones.

    Args:
        W: Observation matrix, or its triangular factor, (n_rows, n).
        subset: Columns of the subset, (n_kept,).

    Returns:
        (n_kept, n - n_kept); the other columns are in ascending order.
    """
    others = np.setdiff1d(np.arange(W.shape[1]), subset)
    scaled, lengths = normalise_columns(W)
    dependent = len(select_independent(W, subset)) < subset.size
    cut = DEPENDENT if dependent else None
    solution, *_ = np.linalg.lstsq(scaled[:, subset], W[:, others], rcond=cut)
    result: FloatArray = solution / lengths[subset, None]
    return result


def compute_relative_error(
    problem: SelectionProblem, subset: IntArray, parameters: FloatArray
) -> float:
    """Return the torque error of a subset with given parameters, as a fraction of the torques."""
    left = problem.chi - problem.W[:, subset] @ parameters
    total = np.linalg.norm(problem.chi)
    return float(np.linalg.norm(left) / total) if total > 0 else 0.0
