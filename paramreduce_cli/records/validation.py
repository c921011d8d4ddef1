"""Errors and costs of reduced models, and the selected model."""

from collections.abc import Mapping
from enum import StrEnum
from typing import ClassVar

import numpy as np

from paramreduce_cli.records.arrays import BoolArray, FloatArray
from paramreduce_cli.records.choices import Choices
from paramreduce_cli.records.model_errors import (
    JointErrors,
    MassMatrices,
    ModelErrors,
    Operations,
    SetErrors,
)
from paramreduce_cli.records.reduction import BySize, ModelChoice, ReducedModel
from paramreduce_cli.records.representation import record


@record
class HeuristicValidation(BySize):
    """The errors and costs of one heuristic's subsets; every array has one row per subset."""

    torque_error: SetErrors
    acceleration_error: SetErrors
    joint_torque_error: JointErrors
    joint_acceleration_error: JointErrors
    mass_matrix: MassMatrices
    operations: Operations

    def get_errors(self, quantity: str) -> SetErrors:
        """Return the errors of ``torque`` or ``acceleration``."""
        return self.torque_error if quantity == "torque" else self.acceleration_error


@record
class Selected:
    """The model that the config asks for."""

    heuristic: str
    model: ReducedModel
    """Reduced model, with expressions."""
    reason: str
    """One sentence that says why it was taken."""
    missed: str
    """Limit that no model keeps; empty if all limits are kept."""

    @property
    def n(self) -> int:
        """Number of parameters."""
        return self.model.n


@record
class Leanest:
    """The function with the fewest operations within the tolerances."""

    model: str
    """``HEURISTIC:N``, or ``terms``."""
    operations: int
    torque_error: ModelErrors


class DataChange(StrEnum):
    """A change of the data on which a selection is repeated."""

    ALL = "all"
    """The data as they are."""
    WITHOUT_TRAJECTORY = "without-trajectory"
    THINNED = "thinned"
    """Every so many samples only."""


@record
class DataVariant:
    """A variant of the data on which a selection is repeated."""

    change: DataChange
    number: int = 0
    """Number of the trajectory left out, from 1; or the step between samples that are kept."""

    def __str__(self) -> str:
        if self.change is DataChange.WITHOUT_TRAJECTORY:
            return f"without trajectory {self.number}"
        if self.change is DataChange.THINNED:
            return f"every {self.number}{'nd' if self.number == 2 else 'th'} sample"
        return "all"


@record
class Stability:
    """The selections on variants of the data; arrays have one row per variant."""

    variants: tuple[DataVariant, ...]
    chosen: BoolArray
    """(n_variants, n_columns)"""
    values: FloatArray
    """Approximate base parameters, not a number where not chosen, (n_variants, n_columns)."""
    torque_error: FloatArray
    """Torque error of each subset on its own data, (n_variants,)."""


@record
class CrossValidation(BySize):
    """The errors of one heuristic's subsets in cross-validation: on parts of the data that were left out of the fit."""

    torque_error: FloatArray
    """(n_folds, m)"""
    full_error: FloatArray
    """Errors of all parameters, (n_folds,)."""

    @property
    def mean(self) -> FloatArray:
        """Mean error over the folds, (m,)."""
        mean: FloatArray = self.torque_error.mean(axis=0)
        return mean

    @property
    def standard_error(self) -> FloatArray:
        """Standard error of the mean, (m,)."""
        folds = self.torque_error.shape[0]
        error: FloatArray = self.torque_error.std(axis=0, ddof=1) / np.sqrt(folds)
        return error


class About(StrEnum):
    """The models that a warning is about."""

    SELECTED = "selected"
    """The selected model."""
    HEURISTICS = "heuristics"
    """Subsets of one or several heuristics."""


@record
class ModelWarning:
    """A reason not to trust a model everywhere."""

    about: About
    text: str


@record
class Validation:
    """The errors and costs of all reduced models, the selected model, and whether it is accepted."""

    FILE: ClassVar[str] = "validation.h5"
    heuristics: Mapping[str, HeuristicValidation]
    full: Mapping[str, float]
    """Operation counts and mass-matrix figures of the full model, by name; counts of textbook recursion and those of the
    base and of the selected model are among them. Empty without a mechanism."""
    nominal_acceleration: FloatArray
    lower: FloatArray
    """Smallest positions, speeds and accelerations of all sets, (3, n_dof)."""
    upper: FloatArray
    """Largest ones, (3, n_dof)."""
    selected: Selected
    pareto: tuple[ModelChoice, ...]
    """Models of the Pareto front, by growing n."""
    stability: Stability | None
    """Stability of the selected subset; None if it was not checked."""
    cross_validation: Mapping[str, CrossValidation] | None
    """Errors on folds by heuristic; None if the size was not chosen by cross-validation."""
    accepted: bool | None
    """None where nothing is judged."""
    verdict: str
    """One sentence that says why."""
    warnings: tuple[ModelWarning, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "heuristics", Choices(self.heuristics))
