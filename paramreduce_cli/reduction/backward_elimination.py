"""Backward Elimination [Ros2019], Algorithm 1."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from paramreduce_cli.multibody.base_parameters import independent_columns
from paramreduce_cli.records import FloatArray, IntArray
from paramreduce_cli.reduction.problem import (
    FULL_PRECISION,
    SelectionProblem,
    first_of_the_best,
)
from paramreduce_cli.registry import heuristic


@heuristic("backward-elimination")
def backward_elimination(problem: SelectionProblem) -> IntArray:
    """Remove, one by one, the parameter whose loss raises the torque error least.

    As long as columns are dependent every removal from the dependency is free; such ties
    remove the least preferred parameter, which leaves the base set that preference itself
    would choose. From there the loss of parameter i costs phi_i^2 / ((W'W)^-1)_ii; costs
    that are round-off are ties too.

    Returns:
        All candidates, the last removed first, (n_candidates,).
    """
    wanted = problem.candidates_by_preference
    left = independent_columns(problem.W, wanted)
    tail = [int(column) for column in wanted if int(column) not in set(left)]
    while left:
        costs = _removal_costs(problem.W[:, left], problem.chi)
        costs[costs < (FULL_PRECISION * np.linalg.norm(problem.chi)) ** 2] = 0.0
        from_the_end = first_of_the_best(-costs[::-1])
        tail.insert(0, left.pop(len(left) - 1 - from_the_end))
    return np.array(tail, dtype=np.int64)


def _removal_costs(W: FloatArray, chi: FloatArray) -> FloatArray:
    """By how much the squared error rises without each column, (n,)."""
    lengths = np.linalg.norm(W, axis=0)
    Q, R = np.linalg.qr(W / lengths)
    inverse = scipy.linalg.solve_triangular(R, np.eye(R.shape[0]))
    phi = inverse @ (Q.T @ chi)
    costs: FloatArray = phi**2 / np.sum(inverse**2, axis=1)
    return costs
