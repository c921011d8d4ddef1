"""How much a selection depends on the data: which parameters other data would choose."""

from collections.abc import Callable, Sequence

import numpy as np

from paramreduce_cli.records import DataVariant, FloatArray, IntArray, Progress, Stability, Tell
from paramreduce_cli.reduction.fitting import fit
from paramreduce_cli.reduction.problem import SelectionProblem


def stability(
    problem: SelectionProblem,
    factors: Sequence[tuple[DataVariant, FloatArray]],
    select: Callable[[SelectionProblem], IntArray],
    tell: Tell,
) -> Stability:
    """Select again on other data.

    Args:
        problem: Whose candidates, preference and groups stay.
        factors: Triangular factors of the weighted [W | chi], with what the data are.
        select: The subset of a problem.
        tell: Told of each.
    """
    n = problem.W.shape[1]
    chosen = np.zeros((len(factors), n), dtype=bool)
    values = np.full((len(factors), n), np.nan)
    errors = np.zeros(len(factors))
    for k, (_, factor) in enumerate(factors):
        other = problem.on(factor)
        subset = select(other)
        fitted = fit(other, subset)
        chosen[k, subset] = True
        values[k, subset] = fitted.parameters
        errors[k] = fitted.torque_error
        tell(Progress("selection on other data", k + 1, len(factors)))
    return Stability(tuple(variant for variant, _ in factors), chosen, values, errors)
