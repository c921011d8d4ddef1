"""Approximate base parameters of a subset and the torque errors they leave."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.multibody.base_parameters import DEPENDENT, independent_columns
from paramreduce_cli.records import Block, FloatArray, IntArray
from paramreduce_cli.reduction.problem import SelectionProblem


@dataclass(frozen=True)
class Fit:
    """Least-squares parameters of one subset."""

    parameters: FloatArray
    """Approximate base parameters phi'_R, (n,)."""
    beta: FloatArray
    """W_E ~ W_R beta with the other columns in ascending order, (n, n_all - n)."""
    torque_error: float
    minimum_norm: bool
    """Whether the columns are dependent, so that the smallest of many solutions was taken."""


def fit(problem: SelectionProblem, subset: IntArray) -> Fit:
    """Fit a subset: phi'_R = W_R^+ chi and beta = W_R^+ W_E [Ros2019], Eqs. 17 and 20.

    Columns are scaled to unit length first, so the minimum norm of a dependent subset is that
    of the torques each parameter causes and does not depend on units.
    """
    others = np.setdiff1d(np.arange(problem.W.shape[1]), subset)
    lengths = np.linalg.norm(problem.W[:, subset], axis=0)
    lengths = np.where(lengths > 0, lengths, 1.0)
    right = np.column_stack([problem.W[:, others], problem.chi])
    dependent = len(independent_columns(problem.W, subset)) < subset.size
    cut = DEPENDENT if dependent else None
    solution, *_ = np.linalg.lstsq(problem.W[:, subset] / lengths, right, rcond=cut)
    solution = solution / lengths[:, None]
    parameters = solution[:, -1]
    left = problem.chi - problem.W[:, subset] @ parameters
    total = np.linalg.norm(problem.chi)
    error = float(np.linalg.norm(left) / total) if total > 0 else 0.0
    return Fit(parameters, solution[:, :-1], error, dependent)


@dataclass(frozen=True)
class NormErrors:
    """Torque errors of many models in three norms; each (n_models,)."""

    one: FloatArray
    two: FloatArray
    infinity: FloatArray
    joints: FloatArray
    """In the 2-norm, joint by joint, (n_models, n_dof)."""


def torque_errors(
    blocks: Iterable[Block], parameters: FloatArray, weights: FloatArray
) -> NormErrors:
    """Errors of many models in one pass over the samples.

    Args:
        blocks: The samples.
        parameters: One model a column, zero where a parameter is not kept, (n_parameters, n_models).
        weights: Each joint's nominal torque, (n_dof,).
    """
    n_models, n_dof = parameters.shape[1], weights.size
    sums = np.zeros((n_models, n_dof))
    squares = np.zeros((n_models, n_dof))
    largest = np.zeros(n_models)
    chi_sum, chi_square, chi_largest = np.zeros(n_dof), np.zeros(n_dof), 0.0
    for block in blocks:
        chi = block.tau / weights
        predicted = (block.W @ parameters).reshape(-1, n_dof, n_models) / weights[:, None]
        error = np.abs(chi[:, :, None] - predicted)
        sums += error.sum(axis=0).T
        squares += (error**2).sum(axis=0).T
        largest = np.maximum(largest, error.max(axis=(0, 1)))
        chi_sum += np.abs(chi).sum(axis=0)
        chi_square += (chi**2).sum(axis=0)
        chi_largest = max(chi_largest, float(np.abs(chi).max()))
    tiny = np.finfo(float).tiny
    return NormErrors(
        one=sums.sum(axis=1) / max(chi_sum.sum(), tiny),
        two=np.sqrt(squares.sum(axis=1) / max(chi_square.sum(), tiny)),
        infinity=largest / max(chi_largest, tiny),
        joints=np.sqrt(squares / np.maximum(chi_square, tiny)),
    )
