"""Inputs of criteria besides the least-squares problem."""

from collections.abc import Callable
from dataclasses import dataclass

from paramreduce_cli.records import FloatArray, IntArray


@dataclass(frozen=True)
class AccelerationData:
    """The linear maps of mass matrix and bias at some samples, by the columns of the selection."""

    A: FloatArray
    """M = A @ phi, (n_samples, n_dof, n_dof, n)."""
    B: FloatArray
    """delta = B @ phi, (n_samples, n_dof, n)."""
    tau: FloatArray
    """(n_samples, n_dof)"""
    ddz: FloatArray
    """(n_samples, n_dof)"""
    nominal: FloatArray
    """Characteristic accelerations, (n_dof,)."""


@dataclass(frozen=True)
class CriterionInputs:
    """The inputs of criteria, computed when a criterion asks for them."""

    error_limit: float
    """Torque error under which the cost is minimised."""
    accelerations: Callable[[int], AccelerationData]
    """Data of at most so many samples of the estimation set."""
    cost: Callable[[IntArray], int]
    """Operations of a model that keeps these columns."""
