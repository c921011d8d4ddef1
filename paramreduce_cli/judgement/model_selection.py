"""Choice of a model from many: the smallest, the best, the Pareto front."""

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from paramreduce_cli.records import (
    BoolArray,
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

_MANY, _SOME, _NEAR = 70, 16, 2
"""Models of a curve from which on only some are shown, how many, and the sizes around the selected one that always are."""
_NONE: Mapping[str, BoolArray] = MappingProxyType({})
_BOTH_SETS = ("estimation", "validation")
_PARTS = {"torque_error": _BOTH_SETS, "acceleration_error": _BOTH_SETS, "operations": ("inverse",)}
"""What tolerances are on: sets of samples, or functions."""


def compute_worst_ratios(
    result: HeuristicValidation, tolerances: Mapping[str, float]
) -> FloatArray:
    """Return the largest ratio of error or cost to its tolerance, over both sets, (m,).

    Args:
        result: Validation of one heuristic.
        tolerances: Tolerances by `torque_error`, `acceleration_error` and `operations`.
    """
    ratios = [
        np.asarray(getattr(result, key)[part], dtype=float) / limit
        for key, limit in tolerances.items()
        for part in _PARTS[key]
    ]
    worst: FloatArray = np.max(ratios, axis=0)
    return worst


def find_smallest_within(
    results: Mapping[str, HeuristicValidation],
    tolerances: Mapping[str, float],
    excluded: Mapping[str, BoolArray] = _NONE,
) -> Pick | None:
    """Return the model with the fewest parameters that keeps all tolerances on both sets, or None.

    If only operations have a tolerance, the model has the smallest error instead. Of several models of that size the
    one with the smallest torque error on the estimation set is returned; of equal ones that of the last heuristic.

    Args:
        results: Validation of each heuristic.
        tolerances: Tolerances by key.
        excluded: Masks of the models that must not be chosen, by heuristic; all may be chosen of heuristics without one.
    """
    good = [
        (name, int(row))
        for name, result in results.items()
        for row in np.flatnonzero(compute_worst_ratios(result, tolerances) <= 1)
        if name not in excluded or not excluded[name][row]
    ]
    if good and set(tolerances) == {"operations"}:
        return _find_best(results, good)
    return _find_smallest(results, good)


def find_nearest_to(
    results: Mapping[str, HeuristicValidation], tolerances: Mapping[str, float]
) -> Pick:
    """Return the model that exceeds the tolerances least."""
    worst = {name: compute_worst_ratios(result, tolerances) for name, result in results.items()}
    name = min(worst, key=lambda name: float(worst[name].min()))
    return name, int(np.argmin(worst[name]))


def find_best_of_size(results: Mapping[str, HeuristicValidation], n: int) -> Pick | None:
    """Return the model of n parameters with the smallest torque error on the estimation set, or None if no heuristic
    has one; of equal models that of the last heuristic.
    """
    rows = {name: result.find_row(n) for name, result in results.items()}
    return _find_smallest(results, [(name, row) for name, row in rows.items() if row is not None])


def _find_smallest(
    results: Mapping[str, HeuristicValidation], picks: Sequence[Pick]
) -> Pick | None:
    """Return the pick with the fewest parameters, of several the one with the smallest torque error on the estimation
    set; None if there are no picks.
    """
    if not picks:
        return None
    n = min(int(results[name].n[row]) for name, row in picks)
    small = [(name, row) for name, row in picks if results[name].n[row] == n]
    return _find_best(results, small)


def _find_best(results: Mapping[str, HeuristicValidation], picks: Sequence[Pick]) -> Pick:
    """Return the pick with the smallest torque error on the estimation set; of equal picks the last."""
    errors = np.array([results[name].torque_error.estimation[row] for name, row in picks])
    return picks[int(np.flatnonzero(errors <= errors.min() * (1 + TIE) + EXACT)[-1])]


def is_proven_smallest(proofs: Proofs, n: int, torque_error: float) -> bool:
    """Return whether it is proven that no subset of fewer than n parameters keeps an error on the estimation set.

    Fewer parameters never have a smaller error, so the bound of the largest size below n decides.
    """
    smaller = np.flatnonzero(proofs.n < n)
    return smaller.size == 0 or bool(proofs.lower_bound[smaller[-1]] > torque_error)


def find_pareto_front(results: Mapping[str, HeuristicValidation]) -> tuple[ModelChoice, ...]:
    """Return the models with known operations that no other model beats in one respect without losing in another.

    The quantities are the number of parameters, both errors on the estimation set and both numbers of operations.
    Models with errors of 100 % are left out; of equal models the first stays.
    """
    picks = list(_iterate_sensible(results))
    if not picks:
        return ()
    values = np.array(
        [[_round_off(column[row]) for column in _list_objectives(results[h])] for h, row in picks]
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


def _list_objectives(result: HeuristicValidation) -> tuple[IntArray | FloatArray, ...]:
    """Return the quantities that the Pareto front minimises, (m,) each."""
    return (
        result.n,
        result.torque_error.estimation,
        result.acceleration_error.estimation,
        result.operations.inverse,
        result.operations.direct,
    )


def list_models(results: Mapping[str, HeuristicValidation]) -> list[ModelChoice]:
    """Return all models of all heuristics."""
    return [ModelChoice(name, int(n)) for name, result in results.items() for n in result.n]


def list_shown_models(
    results: Mapping[str, HeuristicValidation], selected: Selected, front: Sequence[ModelChoice]
) -> list[ModelChoice]:
    """Return the models whose operations the page and the tables show; counting those of all models takes minutes for
    large robots.

    Args:
        results: Validation of each heuristic.
        selected: The selected model.
        front: Models of the Pareto front.

    Returns:
        Sizes of the selected heuristic and of forward selection, the selected size of every heuristic, and the front. Of many
        sizes or models some are left out, but not those near the selected one.
    """
    curves = [
        [ModelChoice(name, n) for n in results[name].n.tolist()]
        for name in dict.fromkeys([selected.heuristic, "forward-selection"])
        if name in results
    ]
    beside = [choice for choice in list_models(results) if choice.n == selected.n]
    thinned = [one for curve in (*curves, front) for one in _thin_out(curve, selected.n)]
    return list(dict.fromkeys([*thinned, *beside]))


def _thin_out(choices: Sequence[ModelChoice], n: int) -> list[ModelChoice]:
    """Return some of many models: those near a size, and others at equal steps, the first and the last among them."""
    if len(choices) <= _MANY:
        return list(choices)
    steps = set(np.linspace(0, len(choices) - 1, _SOME).round().astype(int).tolist())
    return [one for k, one in enumerate(choices) if k in steps or abs(one.n - n) <= _NEAR]


def _round_off(value: float) -> float:
    """Return a number with nine digits, and zero if it is round-off."""
    return 0.0 if value < EXACT else float(f"{value:.9g}")


def _iterate_sensible(results: Mapping[str, HeuristicValidation]) -> Iterator[Pick]:
    """Yield the models with errors below 100 % and known operations."""
    for name, result in results.items():
        sensible = (result.torque_error.estimation < 1) & (result.acceleration_error.estimation < 1)
        sensible &= np.isfinite(result.operations.inverse)
        yield from ((name, int(row)) for row in np.flatnonzero(sensible))
