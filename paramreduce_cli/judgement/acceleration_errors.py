"""Errors of accelerations that reduced models predict, and properties of their mass matrices."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.judgement.torque_errors import compute_joint_errors
from paramreduce_cli.multibody.dynamics import SINGULAR_MASS
from paramreduce_cli.records import Block, BoolArray, FloatArray

Direct = Callable[[FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
"""Generalised coordinates, velocities and the parameters of models to their M and delta."""

_VALUES_AT_ONCE = 1_000_000
"""Mass-matrix elements held in memory at a time."""


@dataclass(frozen=True)
class AccelerationErrors:
    """The acceleration errors and mass-matrix properties of many models."""

    squares: FloatArray
    """Sums of the squares of what is missed, each joint's divided by its nominal acceleration, (n_models, n_dof)."""
    total: FloatArray
    """The same of the accelerations themselves, (n_dof,)."""
    condition: FloatArray
    """Largest condition number of the mass matrix over the samples, (n_models,)."""
    smallest_eigenvalue: FloatArray
    """Smallest eigenvalue of the mass matrix over the samples, (n_models,)."""

    @property
    def error(self) -> FloatArray:
        """Relative error of all joints together, (n_models,)."""
        total = max(self.total.sum(), np.finfo(float).tiny)
        result: FloatArray = np.sqrt(self.squares.sum(axis=1) / total)
        return result

    @property
    def joints(self) -> FloatArray:
        """Joint by joint, (n_models, n_dof)."""
        return compute_joint_errors([self])


def split_prescribed(nominal_acceleration: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Return masks of the coordinates whose accelerations are a result, and of those whose motion is prescribed, (n_dof,) each."""
    free = np.isfinite(nominal_acceleration)
    return free, ~free


def compute_acceleration_errors(
    blocks: Iterable[Block],
    direct: Direct,
    parameters: FloatArray,
    nominal_acceleration: FloatArray,
) -> AccelerationErrors:
    """Return the normalised errors of ddz_R = M_R^-1 (tau - delta_R) [Ros2019], Eq. 24.

    Args:
        blocks: The samples.
        direct: Mass matrices and biases of models.
        parameters: Parameters, one column per model, zero for dropped ones, (n_parameters, n_models).
        nominal_acceleration: Divisor of the errors of each coordinate, (n_dof,); infinite for coordinates whose motion is
            prescribed: their accelerations are given, and mass matrices are those of the others.

    Returns:
        Errors; infinite where a mass matrix is singular at some sample.
    """
    n_models, n_dof = parameters.shape[1], nominal_acceleration.size
    squares, total = np.zeros((n_models, n_dof)), np.zeros(n_dof)
    free, held = (np.flatnonzero(some) for some in split_prescribed(nominal_acceleration))
    condition, smallest = np.zeros(n_models), np.full(n_models, np.inf)
    step = max(1, _VALUES_AT_ONCE // (n_models * n_dof * n_dof))
    for block in blocks:
        for start in range(0, block.time.size, step):
            part = slice(start, start + step)
            found = direct(block.q[part], block.dq[part], parameters)
            M, bias = (np.moveaxis(values, -1, 1) for values in found)
            given = (M[..., held] @ block.ddz[part][:, None, held, None])[..., 0]
            right = (block.tau[part][:, None, :] - bias - given)[..., free, None]
            M = M[..., free, :][..., free]
            values = np.linalg.eigvalsh(M)
            sizes = np.abs(values)
            largest = sizes.max(axis=2)
            singular = sizes.min(axis=2) <= SINGULAR_MASS * np.maximum(
                largest, np.finfo(float).tiny
            )
            M[singular] = np.nan
            ddz = np.linalg.solve(M, right)[..., 0]
            error = (ddz - block.ddz[part][:, None, free]) / nominal_acceleration[free]
            squares[:, free] += np.where(np.isnan(error), np.inf, error**2).sum(axis=0)
            total += np.sum((block.ddz[part] / nominal_acceleration) ** 2, axis=0)
            ratio = np.where(singular, np.inf, largest / np.where(singular, 1.0, sizes.min(axis=2)))
            condition = np.maximum(condition, ratio.max(axis=0))
            smallest = np.minimum(smallest, values.min(axis=(0, 2)))
    return AccelerationErrors(squares, total, condition, smallest)
