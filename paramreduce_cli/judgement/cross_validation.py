"""Cross-validation: errors of selections on parts of the data that were left out."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import scipy  # its stats takes a third of a second to load, so only when it is used

from paramreduce_cli.records import CrossValidation, FloatArray, IntArray, ModelChoice
from paramreduce_cli.reduction.fitting import compute_relative_error, fit
from paramreduce_cli.reduction.problem import SelectionProblem

Selector = Callable[[SelectionProblem], Sequence[IntArray]]
"""Subsets by growing size on some data."""

LARGEST_LOSS = 0.03
"""Relative error that a smaller model may lose, at the upper end of the interval."""
_CONFIDENCE = 0.9
"""Of the one-sided interval."""


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
    full = []
    for rest, left_out in folds:
        learned, tested = problem.replace_data(rest), problem.replace_data(left_out)
        found = {}
        for subset in select(learned):
            parameters = fit(learned, subset).parameters
            found[subset.size] = compute_relative_error(tested, subset, parameters)
        errors.append(found)
        every = problem.candidates
        full.append(compute_relative_error(tested, every, fit(learned, every).parameters))
    n = sorted(set.intersection(*(set(found) for found in errors)))
    return CrossValidation(
        n=np.array(n, dtype=np.int64),
        torque_error=np.array([[found[size] for size in n] for found in errors]),
        full_error=np.array(full),
    )


def choose_by_bounded_loss(results: Mapping[str, CrossValidation]) -> ModelChoice:
    """Return the smallest model that is hardly worse than the best model and than all parameters.

    The upper end of the one-sided 90 % interval of the mean relative difference over the folds is at most 3 %, in both
    comparisons. If no model is within these bounds, the model with the smallest mean error is returned; of several of
    one size, too.
    """
    best = find_best(results)
    best_error = results[best.heuristic].torque_error[:, results[best.heuristic].n == best.n][:, 0]
    good = [
        (int(result.n[k]), float(result.mean[k]), name)
        for name, result in results.items()
        for k in range(result.n.size)
        if all(
            compute_largest_loss(result.torque_error[:, k], reference) <= LARGEST_LOSS
            for reference in (best_error, result.full_error)
        )
    ]
    if not good:
        return best
    n, _, name = min(good)
    return ModelChoice(name, n)


def compute_largest_loss(errors: FloatArray, reference: FloatArray) -> float:
    """Return the upper end of the one-sided 90 % interval of the mean relative difference of errors.

    Args:
        errors: Errors of a model on each fold, (n_folds,).
        reference: Errors of the model that it is compared with, (n_folds,).
    """
    loss = errors / np.maximum(reference, 1e-300) - 1
    width = scipy.stats.t.ppf(_CONFIDENCE, loss.size - 1) * loss.std(ddof=1) / np.sqrt(loss.size)
    return float(loss.mean() + width)


def find_best(results: Mapping[str, CrossValidation]) -> ModelChoice:
    """Return the model with the smallest mean error; of equal ones the smallest."""
    _, n, name = min(
        (float(result.mean[k]), int(result.n[k]), name)
        for name, result in results.items()
        for k in range(result.n.size)
    )
    return ModelChoice(name, n)


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
