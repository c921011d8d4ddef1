"""Which of many judged models to take, and which of them are worth a look."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from paramreduce_cli.records import (
    FloatArray,
    HeuristicValidation,
    IntArray,
    ModelChoice,
    Proofs,
    Selected,
)
from paramreduce_cli.reduction.problem import TIE
from paramreduce_cli.texts import EXACT

Pick = tuple[str, int]
"""A heuristic, and the row of one of its subsets."""

_BOTH_SETS = ("estimation", "validation")
_PARTS = {"torque_error": _BOTH_SETS, "acceleration_error": _BOTH_SETS, "operations": ("inverse",)}
"""What tolerances are on: sets of samples, or functions."""


def excess(result: HeuristicValidation, tolerances: Mapping[str, float]) -> FloatArray:
    """Largest ratio of what a tolerance is on to the tolerance, over both sets, (m,).

    Args:
        result: Of one heuristic.
        tolerances: By `torque_error`, `acceleration_error` and `operations`.
    """
    ratios = [
        np.asarray(getattr(result, key)[part], dtype=float) / limit
        for key, limit in tolerances.items()
        for part in _PARTS[key]
    ]
    worst: FloatArray = np.max(ratios, axis=0)
    return worst


def smallest_within(
    results: Mapping[str, HeuristicValidation], tolerances: Mapping[str, float]
) -> Pick | None:
    """The model with the fewest parameters that keeps to all tolerances on both sets.

    Operations alone ask for the smallest error that they can buy instead. Of several with as many
    parameters the one with the smallest torque error on the estimation set, of equal ones the last
    heuristic's; None if there is none.
    """
    good = [
        (name, int(row))
        for name, result in results.items()
        for row in np.flatnonzero(excess(result, tolerances) <= 1)
    ]
    if good and set(tolerances) == {"operations"}:
        return _best(results, good)
    return _smallest_then_best(results, good)


def nearest_to(results: Mapping[str, HeuristicValidation], tolerances: Mapping[str, float]) -> Pick:
    """The model that misses the tolerances least."""
    worst = {name: excess(result, tolerances) for name, result in results.items()}
    name = min(worst, key=lambda name: float(worst[name].min()))
    return name, int(np.argmin(worst[name]))


def best_of_size(results: Mapping[str, HeuristicValidation], n: int) -> Pick | None:
    """The model of n parameters with the smallest torque error on the estimation set.

    Of equal ones the last heuristic's; None if no heuristic has such a model.
    """
    rows = {name: result.find_row(n) for name, result in results.items()}
    return _smallest_then_best(
        results, [(name, row) for name, row in rows.items() if row is not None]
    )


def _smallest_then_best(
    results: Mapping[str, HeuristicValidation], picks: Sequence[Pick]
) -> Pick | None:
    if not picks:
        return None
    n = min(int(results[name].n[row]) for name, row in picks)
    small = [(name, row) for name, row in picks if results[name].n[row] == n]
    return _best(results, small)


def _best(results: Mapping[str, HeuristicValidation], picks: Sequence[Pick]) -> Pick:
    """Of the smallest torque error on the estimation set; of equal ones the last."""
    errors = np.array([results[name].torque_error.estimation[row] for name, row in picks])
    return picks[int(np.flatnonzero(errors <= errors.min() * (1 + TIE) + EXACT)[-1])]


def proven_necessary(proofs: Proofs, n: int, torque_error: float) -> bool:
    """Whether no subset of fewer than n parameters keeps to an error on the estimation set.

    Fewer parameters never have a smaller error, so the bound of the largest size below n decides.
    """
    smaller = np.flatnonzero(proofs.n < n)
    return smaller.size == 0 or bool(proofs.lower_bound[smaller[-1]] > torque_error)


def pareto_front(results: Mapping[str, HeuristicValidation]) -> tuple[ModelChoice, ...]:
    """Models whose operations are known and that no other one beats in something without losing in something else.

    Compared are the number of parameters, both errors on the estimation set and both operation
    counts; models with errors of a hundred per cent are left out. Of equal models the first stays.
    """
    picks = list(_sensible(results))
    if not picks:
        return ()
    values = np.array(
        [[_resolved(column[row]) for column in _compared(results[h])] for h, row in picks]
    )
    front = []
    for k, own in enumerate(values):
        no_worse = (values <= own).all(axis=1)
        better = no_worse & (values < own).any(axis=1)
        equal_before = (no_worse & (values == own).all(axis=1))[:k]
        if not better.any() and not equal_before.any():
            front.append(picks[k])
    order = np.argsort([results[h].n[row] for h, row in front], kind="stable")
    return tuple(ModelChoice(front[k][0], int(results[front[k][0]].n[front[k][1]])) for k in order)


def _compared(result: HeuristicValidation) -> tuple[IntArray | FloatArray, ...]:
    """Return what models are compared by, the less the better, (m,) each."""
    return (
        result.n,
        result.torque_error.estimation,
        result.acceleration_error.estimation,
        result.operations.inverse,
        result.operations.direct,
    )


def every_model(results: Mapping[str, HeuristicValidation]) -> list[ModelChoice]:
    """Return all models of all heuristics."""
    return [ModelChoice(name, int(n)) for name, result in results.items() for n in result.n]


def shown_models(
    results: Mapping[str, HeuristicValidation], selected: Selected, front: Sequence[ModelChoice]
) -> list[ModelChoice]:
    """Return the models whose operations people look at; to count those of all takes minutes for large robots.

    Args:
        results: Validation of each heuristic.
        selected: The selected model.
        front: Models of the Pareto front.

    Returns:
        All sizes of the selected heuristic and of forward selection, the selected size of every heuristic, and the front.
    """
    whole = {selected.heuristic, "forward-selection"}
    shown = [
        choice
        for choice in every_model(results)
        if choice.heuristic in whole or choice.n == selected.n
    ]
    return list(dict.fromkeys([*shown, *front]))


def _resolved(value: float) -> float:
    """A number without what is round-off in it."""
    return 0.0 if value < EXACT else float(f"{value:.9g}")


def _sensible(results: Mapping[str, HeuristicValidation]) -> Iterator[Pick]:
    for name, result in results.items():
        sensible = (result.torque_error.estimation < 1) & (result.acceleration_error.estimation < 1)
        sensible &= np.isfinite(result.operations.inverse)
        yield from ((name, int(row)) for row in np.flatnonzero(sensible))
