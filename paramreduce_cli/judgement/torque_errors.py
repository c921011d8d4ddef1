"""Errors of torques that reduced models predict, in three norms."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from paramreduce_cli.records import Block, FloatArray

_TINY = np.finfo(float).tiny


@dataclass(frozen=True)
class NormErrors:
    """The torque errors of many models in three norms."""

    one: FloatArray
    """(n_models,)"""
    infinity: FloatArray
    """(n_models,)"""
    squares: FloatArray
    """Sums of the squares of what is missed, each joint's divided by its nominal torque, (n_models, n_dof)."""
    total: FloatArray
    """The same of the torques themselves, (n_dof,); not a number where they are not measured."""
    lower: FloatArray
    """Smallest positions, speeds and accelerations that were met, (3, n_dof)."""
    upper: FloatArray
    """Largest ones, (3, n_dof)."""

    @property
    def two(self) -> FloatArray:
        """Relative error in the 2-norm, (n_models,)."""
        result: FloatArray = np.sqrt(self.squares.sum(axis=1) / max(np.nansum(self.total), _TINY))
        return result

    @property
    def joints(self) -> FloatArray:
        """Relative error in the 2-norm, joint by joint, (n_models, n_dof); NaN where torques are not measured."""
        return compute_joint_errors([self])


class Squares(Protocol):
    """A pair of sums of squares over a part of the samples."""

    @property
    def squares(self) -> FloatArray:
        """Sum of the squared errors, (n_models, n_dof)."""

    @property
    def total(self) -> FloatArray:
        """Sum of the squared quantity, (n_dof,)."""


def compute_joint_errors(parts: Sequence[Squares]) -> FloatArray:
    """Return relative errors joint by joint over all parts together, (n_models, n_dof)."""
    squares = np.sum([part.squares for part in parts], axis=0)
    total = np.sum([part.total for part in parts], axis=0)
    result: FloatArray = np.sqrt(squares / np.maximum(total, _TINY))
    return result


def compute_torque_errors(
    blocks: Iterable[Block], parameters: FloatArray, weights: FloatArray
) -> NormErrors:
    """Return the torque errors of many models, and the range of the states, in one pass over the samples.

    Args:
        blocks: The samples.
        parameters: Parameters, one column per model, zero for dropped ones, (n_parameters, n_models).
        weights: Nominal torque of each joint, (n_dof,); infinite where it is not measured.
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
    chi_square[np.isinf(weights)] = np.nan
    return NormErrors(
        one=sums.sum(axis=1) / max(chi_sum.sum(), _TINY),
        infinity=largest / max(chi_largest, _TINY),
        squares=squares,
        total=chi_square,
        lower=lower,
        upper=upper,
    )
