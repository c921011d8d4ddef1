"""The function with the fewest operations within tolerances, with only parameters or also terms removed."""

from collections.abc import Iterator, Mapping

import numpy as np

from paramreduce_cli.config.schema import SelectedSection
from paramreduce_cli.records import TERMS, HeuristicValidation, Leanest, ModelErrors, TermReduction

_BOTH = ("estimation", "validation")

Tolerances = Mapping[str, float]
_Limits = Mapping[tuple[str, str], float]
"""Largest errors by quantity and set."""
Results = Mapping[str, HeuristicValidation]


def find_leanest(
    function: str, section: SelectedSection, results: Results, terms: TermReduction | None
) -> Leanest | None:
    """Return the function with the fewest operations whose errors are within the tolerances, or None.

    The tolerances are those under ``selected`` for both sets; without these, the budgets of pruned terms for their
    sets; without these, the defaults. Errors of accelerations count for the direct dynamics only. Their mass matrices
    must be positive definite on both sets, and so must those of inverse dynamics that are to simulate, too.

    Args:
        function: ``inverse`` or ``direct``.
        section: Limits of the config.
        results: Errors and costs of the reduced models.
        terms: Functions with pruned terms, if there are any.

    Returns:
        None if there is none.
    """
    tolerances = _list_tolerances(function, section.get_tolerances())
    looked_at: tuple[str, ...] = _BOTH
    if not tolerances and terms is not None:
        budget = {
            "torque_error": terms.torque_budget,
            "acceleration_error": terms.acceleration_budget,
        }
        tolerances = _list_tolerances(function, budget)
        looked_at = _BOTH[:1] if terms.held_out else _BOTH
    usual = _list_tolerances(function, {**SelectedSection.USUAL, **section.list_tolerances()})
    limits = {
        (key, part): limit for key, limit in (tolerances or usual).items() for part in looked_at
    }
    simulated = function == "direct" or section.use == "simulation"
    found = [
        *_iterate_models(function, limits, results, simulated),
        *_iterate_term_models(function, limits, terms),
    ]
    return min(found, key=_rank, default=None)


def _list_tolerances(function: str, given: Tolerances) -> Tolerances:
    """Return the finite tolerances of the errors that a function has."""
    kinds = ("torque_error", "acceleration_error")[: 2 if function == "direct" else 1]
    return {key: given[key] for key in kinds if np.isfinite(given.get(key, np.inf))}


def _rank(candidate: Leanest) -> tuple[int, float]:
    """Return operations, then torque error: what the leanest function minimises."""
    return candidate.operations, candidate.torque_error.estimation


def _iterate_models(
    function: str, limits: _Limits, results: Results, simulated: bool
) -> Iterator[Leanest]:
    """Yield the functions of models with only parameters removed, as far as their operations are known; of models to
    simulate with only those with positive definite mass matrices.
    """
    for heuristic, result in results.items():
        kept = [getattr(result, key)[part] <= limit for (key, part), limit in limits.items()]
        if simulated:
            kept.append(result.mass_matrix.smallest_eigenvalue > 0)
        operations = result.operations[function]
        kept.append(np.isfinite(operations))
        for row in np.flatnonzero(np.all(kept, axis=0)):
            yield Leanest(
                f"{heuristic}:{result.n[row]}",
                int(operations[row]),
                ModelErrors(
                    float(result.torque_error.estimation[row]),
                    float(result.torque_error.validation[row]),
                    result.torque_error.test[row],
                ),
            )


def _iterate_term_models(
    function: str, limits: _Limits, terms: TermReduction | None
) -> Iterator[Leanest]:
    """Yield the function with pruned terms, if there is one and its errors are within the limits."""
    one = None if terms is None else terms.functions.get(function)
    if one is not None and all(
        getattr(one, key)[part] <= limit for (key, part), limit in limits.items()
    ):
        yield Leanest(TERMS, one.operations, one.torque_error)
