"""Stability of a selection: the parameters that other data would select."""

from collections.abc import Callable, Sequence

import numpy as np

from paramreduce_cli.records import (
    DataVariant,
    FloatArray,
    IntArray,
    Progress,
    ProgressCallback,
    Stability,
)
from paramreduce_cli.reduction.fitting import fit
from paramreduce_cli.reduction.problem import SelectionProblem


def measure_stability(
    problem: SelectionProblem,
    factors: Sequence[tuple[DataVariant, FloatArray]],
    select: Callable[[SelectionProblem], IntArray],
    report_progress: ProgressCallback,
) -> Stability:
    """Repeat the selection on variants of the data, and return how the chosen parameters and the errors change.

    Args:
        problem: Selection problem, whose candidates, preference and groups stay.
        factors: Triangular factors of the weighted [W | chi], with the variant of the data.
        select: Function that returns the subset for a problem.
        report_progress: Progress callback.
    """
    n = problem.W.shape[1]
    chosen = np.zeros((len(factors), n), dtype=bool)
    values = np.full((len(factors), n), np.nan)
    errors = np.zeros(len(factors))
    for k, (_, factor) in enumerate(factors):
        other = problem.replace_data(factor)
        subset = select(other)
        fitted = fit(other, subset)
        chosen[k, subset] = True
        values[k, subset] = fitted.parameters
        errors[k] = fitted.torque_error
        report_progress(Progress("selection on other data", k + 1, len(factors)))
    return Stability(tuple(variant for variant, _ in factors), chosen, values, errors)
