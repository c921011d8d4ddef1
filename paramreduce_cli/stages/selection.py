"""Which reduced model the config asks for."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from paramreduce_cli.config.schema import SelectedSection
from paramreduce_cli.errors import ConfigError, DataError
from paramreduce_cli.multibody.relations import approximate_expressions
from paramreduce_cli.records import HeuristicValidation, Model, Reduction, Selected
from paramreduce_cli.reduction.picking import (
    Choice,
    best_of_size,
    excess,
    nearest_to,
    proven_necessary,
    smallest_within,
)

_DEFAULT = {"torque_error": 0.01}


def select(
    wanted: SelectedSection,
    model: Model,
    reduction: Reduction,
    results: Mapping[str, HeuristicValidation],
) -> Selected:
    """The model of the size asked for, or the smallest one within the tolerances on both sets.

    Raises:
        ConfigError: There is no such model.
        DataError: The heuristic asked for was not run.
    """
    if wanted.heuristic is not None:
        if wanted.heuristic not in results:
            raise DataError(
                f"reduction.h5 has no {wanted.heuristic}; run `paramreduce reduce` with this config."
            )
        results = {wanted.heuristic: results[wanted.heuristic]}
    if wanted.n is not None:
        heuristic, row = _of_size(wanted.n, results)
        reason = f"{heuristic} with the {wanted.n} parameters that selected.n asks for."
    else:
        tolerances = wanted.tolerances() or _DEFAULT
        heuristic, row = _within(tolerances, results)
        reason = _reason(tolerances, reduction, heuristic, int(results[heuristic].n[row]))
    found = reduction.heuristics[heuristic]
    kept = found.subsets[row]
    known = np.linalg.pinv(reduction.expansion) @ model.values
    return Selected(
        heuristic=heuristic,
        n=int(found.n[row]),
        parameters=tuple(reduction.names[k] for k in kept),
        values=found.parameters[row],
        expressions=tuple(approximate_expressions(reduction.names, kept, found.beta[row], known)),
        reason=reason,
    )


def _of_size(n: int, results: Mapping[str, HeuristicValidation]) -> Choice:
    choice = best_of_size(results, n)
    if choice is not None:
        return choice
    sizes = sorted({int(k) for result in results.values() for k in result.n})
    who = " and ".join(results)
    raise ConfigError(
        f"selected.n is {n}, but {who} orders {sizes[-1]} parameters. Ask for fewer, or let "
        "reduction.stop go further."
        if n > sizes[-1]
        else f"selected.n is {n}, but with groups {who} has subsets of "
        f"{', '.join(map(str, sizes))} parameters only. Choose one of these."
    )


def _within(tolerances: Mapping[str, float], results: Mapping[str, HeuristicValidation]) -> Choice:
    choice = smallest_within(results, tolerances)
    if choice is not None:
        return choice
    name, row = nearest_to(results, tolerances)
    worst = float(excess(results[name], tolerances)[row])
    raise ConfigError(
        f"selected.{next(iter(tolerances))}: no model keeps to {_listed(tolerances)} on both sets; the "
        f"nearest is {name} with {results[name].n[row]} parameters, {worst:.3g} times too large. "
        "Allow more, or let reduction.stop go further."
    )


def _reason(tolerances: Mapping[str, float], reduction: Reduction, heuristic: str, n: int) -> str:
    text = f"{heuristic} with {n} parameters is the smallest model found with {_listed(tolerances)} on both sets"
    limit = tolerances.get("torque_error")
    if reduction.proofs is None or limit is None:
        return f"{text}."
    if proven_necessary(reduction.proofs, n, limit) < n:
        return (
            f"{text}; proven: none of {n - 1} or fewer has that torque error on the estimation set."
        )
    return f"{text}; smaller ones are not excluded by proof."


def _listed(tolerances: Mapping[str, float]) -> str:
    shown = (
        f"{key.replace('_', ' ')} at most "
        + (f"{100 * value:.3g} %" if "error" in key else f"{value:g}")
        for key, value in tolerances.items()
    )
    return " and ".join(shown)
