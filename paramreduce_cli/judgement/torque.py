"""Errors of the torques that reduced models predict, in three norms."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.records import Block, FloatArray


@dataclass(frozen=True)
class NormErrors:
    """Torque errors of many models in three norms; each (n_models,)."""

    one: FloatArray
    two: FloatArray
    infinity: FloatArray
    joints: FloatArray
    """In the 2-norm, joint by joint, (n_models, n_dof); not a number where torques are not measured."""
    lower: FloatArray
    """Smallest positions, speeds and accelerations that were met, (3, n_dof)."""
    upper: FloatArray
    """Largest ones, (3, n_dof)."""


def torque_errors(
    blocks: Iterable[Block], parameters: FloatArray, weights: FloatArray
) -> NormErrors:
    """Errors of many models in one pass over the samples.

    Args:
        blocks: The samples.
        parameters: One model a column, zero where a parameter is not kept, (n_parameters, n_models).
        weights: Each joint's nominal torque, (n_dof,); infinite where it is not measured.
    """
    n_models, n_dof = parameters.shape[1], weights.size
    sums = np.zeros((n_models, n_dof))
    squares = np.zeros((n_models, n_dof))
    largest = np.zeros(n_models)
    chi_sum, chi_square, chi_largest = np.zeros(n_dof), np.zeros(n_dof), 0.0
    lower, upper = np.full((3, n_dof), np.inf), np.full((3, n_dof), -np.inf)
    for block in blocks:
        states = np.array([block.z, block.dz, block.ddz])
        lower = np.minimum(lower, states.min(axis=1))
        upper = np.maximum(upper, states.max(axis=1))
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
    joints = np.sqrt(squares / np.maximum(chi_square, tiny))
    joints[:, np.isinf(weights)] = np.nan
    return NormErrors(
        one=sums.sum(axis=1) / max(chi_sum.sum(), tiny),
        two=np.sqrt(squares.sum(axis=1) / max(chi_square.sum(), tiny)),
        infinity=largest / max(chi_largest, tiny),
        joints=joints,
        lower=lower,
        upper=upper,
    )
