"""Errors of models by set, and operations by function."""

from typing import Any, NamedTuple

import numpy as np

from paramreduce_cli.records.arrays import FloatArray
from paramreduce_cli.records.representation import record


class ErrorRange(NamedTuple):
    """The range of one model's errors over the motions of the test set; NaN without a test set."""

    median: float
    least: float
    worst: float

    @classmethod
    def summarise(cls, errors: FloatArray) -> "ErrorRange":
        """Return the median and the range of one model's errors, (n_motions,)."""
        if not errors.size:
            return NO_MOTIONS
        return cls(float(np.median(errors)), float(errors.min()), float(errors.max()))


NO_MOTIONS = ErrorRange(np.nan, np.nan, np.nan)


@record
class _Named:
    """A record whose fields can be taken by a name that is known only at run time."""

    def __getitem__(self, name: str) -> Any:
        return getattr(self, name)


@record
class ModelErrors(_Named):
    """The relative errors of one model on each set."""

    estimation: float
    validation: float
    test: FloatArray
    """Errors on every motion of the test set, which no search looks at, (n_motions,)."""


@record
class SetErrors(_Named):
    """The relative errors of several models on each set, one row per model."""

    estimation: FloatArray
    """(m,)"""
    validation: FloatArray
    """(m,)"""
    test: FloatArray
    """Errors on every motion of the test set, (m, n_motions); no columns where there is no test set."""


@record
class JointErrors(_Named):
    """The relative errors of single joints on each set, (m, n_dof); over all motions of the test set together."""

    estimation: FloatArray
    validation: FloatArray
    test: FloatArray


@record
class Operations(_Named):
    """The operations of the lean functions, (m,); NaN where a model is not shown, and so not counted."""

    inverse: FloatArray
    direct: FloatArray


@record
class MassMatrices(_Named):
    """The properties of models' mass matrices over all samples, (m,)."""

    condition: FloatArray
    """Largest condition number."""
    smallest_eigenvalue: FloatArray
