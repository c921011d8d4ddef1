"""The leanest function within tolerances, whether parameters alone or terms were left out."""

from collections.abc import Iterator, Mapping

import numpy as np

from paramreduce_cli.config.schema import SelectedSection
from paramreduce_cli.judgement.picking import ON_BOTH_SETS, excess
from paramreduce_cli.records import TERMS, HeuristicValidation, Leanest, TermReduction

Tolerances = Mapping[str, float]
Results = Mapping[str, HeuristicValidation]


def leanest(
    function: str, wanted: SelectedSection, results: Results, terms: TermReduction | None
) -> Leanest | None:
    """The function with the fewest operations whose errors are within what is asked for on both sets.

    That are the errors under ``selected``, else those that terms were left out within, else the usual
    ones. Errors of accelerations count for the direct dynamics alone, whose mass matrices must be
    positive definite on both sets.

    Args:
        function: ``inverse`` or ``direct``.
        wanted: What the config asks for.
        results: What reduced models are worth.
        terms: Functions with terms left out, if there are any.

    Returns:
        None if there is none.
    """
    tolerances = _tolerances(function, wanted, terms)
    found = [*_alone(function, tolerances, results), *_without_terms(function, tolerances, terms)]
    return min(found, key=lambda one: one.operations, default=None)


def _tolerances(function: str, wanted: SelectedSection, terms: TermReduction | None) -> Tolerances:
    given = {key: value for key, value in wanted.tolerances().items() if key != "operations"}
    if not given and terms is not None:
        given = {
            "torque_error": terms.torque_budget,
            "acceleration_error": terms.acceleration_budget,
        }
    given = given or dict(SelectedSection.USUAL)
    if function == "inverse":
        given.pop("acceleration_error", None)
    return given


def _alone(function: str, tolerances: Tolerances, results: Results) -> Iterator[Leanest]:
    """Functions of models with parameters alone left out."""
    for heuristic, result in results.items():
        within = excess(result, tolerances) <= 1 if tolerances else np.ones(result.n.size, bool)
        if function == "direct":
            within &= result.mass_matrix_smallest_eigenvalue > 0
        operations = getattr(result, f"operations_{function}")
        for row in np.flatnonzero(within):
            yield Leanest(
                f"{heuristic}:{result.n[row]}",
                int(operations[row]),
                float(result.torque_error_estimation[row]),
                float(result.torque_error_validation[row]),
            )


def _without_terms(
    function: str, tolerances: Tolerances, terms: TermReduction | None
) -> Iterator[Leanest]:
    one = None if terms is None else terms.functions.get(function)
    if one is None:
        return
    errors = [
        (getattr(one, name), limit)
        for key, limit in tolerances.items()
        for name in ON_BOTH_SETS[key]
    ]
    if all(error <= limit for error, limit in errors):
        yield Leanest(
            TERMS, one.operations, one.torque_error_estimation, one.torque_error_validation
        )
