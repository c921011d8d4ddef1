"""Cross-validation: errors of selections on parts of the data that were left out."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from paramreduce_cli.records import CrossValidation, FloatArray, IntArray, ModelChoice
from paramreduce_cli.reduction.fitting import compute_relative_error, fit
from paramreduce_cli.reduction.problem import SelectionProblem

Selector = Callable[[SelectionProblem], Sequence[IntArray]]
"""Subsets by growing size on some data."""


def cross_validate(
    problem: SelectionProblem, folds: Sequence[tuple[FloatArray, FloatArray]], select: Selector
) -> CrossValidation:
    """Return the errors of selections that are repeated without each fold, on that fold [Hastie2009], Sec. 7.10.

    Args:
        problem: Selection problem on all data.
        folds: Triangular factors of the data without each fold, and of the fold.
        select: The heuristic.
    """
    errors: list[dict[int, float]] = []
    for rest, left_out in folds:
        learned, tested = problem.replace_data(rest), problem.replace_data(left_out)
        found = {}
        for subset in select(learned):
            parameters = fit(learned, subset).parameters
            found[subset.size] = compute_relative_error(tested, subset, parameters)
        errors.append(found)
    n = sorted(set.intersection(*(set(found) for found in errors)))
    return CrossValidation(
        n=np.array(n, dtype=np.int64),
        torque_error=np.array([[found[size] for size in n] for found in errors]),
    )


def choose_by_one_standard_error(results: Mapping[str, CrossValidation]) -> ModelChoice:
    """Return the smallest model whose mean error is within one standard error of the best model's; of several of that
    size, the model with the smallest mean error.
    """
    best = min(results.values(), key=lambda r: float(r.mean.min()))
    row = int(np.argmin(best.mean))
    limit = float(best.mean[row] + best.standard_error[row])
    good = [
        (int(result.n[k]), float(result.mean[k]), name)
        for name, result in results.items()
        for k in np.flatnonzero(result.mean <= limit).tolist()
    ]
    n, _, name = min(good)
    return ModelChoice(name, n)
