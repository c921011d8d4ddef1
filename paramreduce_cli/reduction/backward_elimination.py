"""Backward Elimination [Ros2019], Algorithm 1."""

from __future__ import annotations

import numpy as np

from paramreduce_cli.multibody.base_parameters import DEPENDENT
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

    As long as columns are dependent many removals are free. Which of them comes first decides
    what can be reached later, so it is not left to chance: of the free ones the parameter goes
    that causes the smallest torques in the fit of least norm, whose unknowns are the torques
    that the parameters cause. From there the loss of parameter i costs
    phi_i^2 / ((W'W)^-1)_ii. Costs of groups are per parameter; costs that are round-off are
    ties, and ties remove the least preferred.

    Returns:
        All candidates, the last removed first, (n_candidates,).
    """
    left = problem.units()
    lengths = np.linalg.norm(problem.W, axis=0)
    X = problem.W / np.where(lengths > 0, lengths, 1.0)
    smallest = (FULL_PRECISION * np.linalg.norm(problem.chi)) ** 2
    tail: list[int] = []
    while left:
        costs = _costs(X, problem.chi, left)
        costs[costs < smallest] = 0.0
        last = len(left) - 1 - first_of_the_best(-costs[::-1])
        tail = [*left.pop(last).tolist(), *tail]
    return np.array(tail, dtype=np.int64)


def _costs(X: FloatArray, chi: FloatArray, units: list[IntArray]) -> FloatArray:
    """What each unit's removal costs per column, (n_units,).

    By how much the squared error rises; where removals are free, the squared torques of the
    free units in the fit of least norm, and infinity for the others.
    """
    columns = np.concatenate(units)
    sizes = np.array([unit.size for unit in units])
    parts = np.split(np.arange(columns.size), np.cumsum(sizes)[:-1])
    U, s, Vt = np.linalg.svd(X[:, columns], full_matrices=True)
    rank = int(np.sum(s > DEPENDENT * s[0]))
    phi = Vt[:rank].T @ ((U[:, :rank].T @ chi) / s[:rank])
    null = Vt[rank:].T
    if rank < columns.size:
        free = [np.linalg.matrix_rank(null[part], tol=1e-6) == part.size for part in parts]
        if any(free):
            own = [
                float(phi[p] @ phi[p]) if f else np.inf for p, f in zip(parts, free, strict=True)
            ]
            return np.array(own) / sizes
        return np.array([_rise(X[:, columns], chi, part) for part in parts]) / sizes
    inverse = (Vt.T / s**2) @ Vt
    if (sizes == 1).all():
        alone: FloatArray = phi**2 / np.diag(inverse)
        return alone
    rises = [phi[p] @ np.linalg.solve(inverse[np.ix_(p, p)], phi[p]) for p in parts]
    return np.array(rises) / sizes


def _rise(X: FloatArray, chi: FloatArray, part: IntArray) -> float:
    """Rise of the squared error without some columns, by fitting twice."""

    def squared_error(kept: FloatArray) -> float:
        left = chi - kept @ np.linalg.lstsq(kept, chi, rcond=DEPENDENT)[0] if kept.size else chi
        return float(left @ left)

    return squared_error(np.delete(X, part, axis=1)) - squared_error(X)
