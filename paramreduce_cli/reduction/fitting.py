"""Least-squares fits of subsets, and the torque errors that they leave."""

from dataclasses import dataclass

import numpy as np

from paramreduce_cli.multibody.orthogonal import DEPENDENT, select_independent
from paramreduce_cli.records import FloatArray, IntArray
from paramreduce_cli.reduction.problem import SelectionProblem


@dataclass(frozen=True)
class Fit:
    """A least-squares fit of one subset."""

    parameters: FloatArray
    """Approximate base parameters phi'_R, (n,)."""
    beta: FloatArray
    """W_E ~ W_R beta with the other columns in ascending order, (n, n_all - n)."""
    torque_error: float
    minimum_norm: bool
    """Whether the columns are dependent, so that the smallest of many solutions was taken."""


def fit(problem: SelectionProblem, subset: IntArray) -> Fit:
    """Fit a subset: phi'_R = W_R^+ chi and beta = W_R^+ W_E [Ros2019], Eqs. 17 and 20.

    Columns are scaled to unit length first. The minimum norm of a dependent subset is therefore that of the torques of
    the parameters, and does not depend on units.
    """
    others = np.setdiff1d(np.arange(problem.W.shape[1]), subset)
    right = np.column_stack([problem.W[:, others], problem.chi])
    dependent = len(select_independent(problem.W, subset)) < subset.size
    cut = DEPENDENT if dependent else None
    solution, *_ = np.linalg.lstsq(problem.X[:, subset], right, rcond=cut)
    solution = solution / problem.lengths[subset, None]
    parameters = solution[:, -1]
    error = compute_relative_error(problem, subset, parameters)
    return Fit(parameters, solution[:, :-1], error, dependent)


def compute_relative_error(
    problem: SelectionProblem, subset: IntArray, parameters: FloatArray
) -> float:
    """Return the torque error of a subset with given parameters, as a fraction of the torques."""
    left = problem.chi - problem.W[:, subset] @ parameters
    total = np.linalg.norm(problem.chi)
    return float(np.linalg.norm(left) / total) if total > 0 else 0.0
