"""Models of parameters: the full model, the base parameters, and every subset found."""

from dataclasses import replace

import numpy as np

from paramreduce_cli.multibody.relations import approximate_expressions
from paramreduce_cli.records import (
    Columns,
    FloatArray,
    IntArray,
    Kind,
    Model,
    ReducedModel,
    Reduction,
)
from paramreduce_cli.reduction.fitting import compute_lumping

_STIFF = 1e-6
"""Size of a large change of a drive's parameter: much less than that of a body's."""
_MOSTLY = 0.5
"""Fraction of a lumped value from which on a parameter makes up most of it."""
_NOTHING = 1e-9
"""Fraction of the torques below which a parameter's contribution is round-off."""


def list_choices(reduction: Reduction) -> list[str]:
    """List the possible model choices, a text for each heuristic: ``swap:1...7``, or with groups ``swap:2|4|6``."""
    return [
        f"{name}:{f'1...{found.n[-1]}' if found.n[-1] == found.n.size else '|'.join(map(str, found.n))}"
        for name, found in reduction.heuristics.items()
    ]


def make_full_model(model: Model) -> ReducedModel:
    """Return the model of all standard parameters that have an effect on the torques, before regrouping."""
    kept = np.flatnonzero(model.affecting)
    return _make_model(model, kept, model.values[kept])


def make_base_model(model: Model) -> ReducedModel:
    """Return the model of the base parameters."""
    return _make_model(model, model.base.columns, model.base_values, model.base.expressions)


def find_closest_standard(model: Model, chosen: ReducedModel) -> FloatArray:
    """Return the standard parameters closest to the robot's own among all that give the same torques as a model.

    Distances are divided by the size of each body; parameters of drives change only where bodies cannot give the same
    effect.

    Args:
        model: Model of the robot.
        chosen: Model whose torques the parameters must give.

    Returns:
        (n_parameters,)
    """
    columns, n = model.base.columns, model.values.size
    to_base = np.zeros((columns.size, n))
    to_base[np.arange(columns.size), columns] = 1.0
    to_base[:, np.setdiff1d(np.arange(n), columns)] = model.base.beta
    missing = to_base @ (chosen.standard - model.values)
    sizes = _compute_scales(model)
    change, *_ = np.linalg.lstsq(to_base * sizes, missing, rcond=None)
    return model.values + sizes * change


def _compute_scales(model: Model) -> FloatArray:
    """Return the magnitude of a large change of each parameter, (n_parameters,), which distances are divided by."""
    sizes = _STIFF * (np.abs(model.values) + 1.0)
    for rigid in model.mechanism.rigid:
        values = {kind: abs(float(model.values[column])) for kind, column in rigid.columns.items()}
        mass = values[Kind.M] or 1.0
        squared = (values[Kind.IXX] + values[Kind.IYY] + values[Kind.IZZ]) / mass or 1e-2
        scales = {Kind.M: mass, **dict.fromkeys((Kind.MX, Kind.MY, Kind.MZ), mass * squared**0.5)}
        for kind, column in rigid.columns.items():
            sizes[column] = scales.get(kind, mass * squared)
    return sizes


def _make_model(
    model: Model, kept: IntArray, values: FloatArray, expressions: tuple[str, ...] = ()
) -> ReducedModel:
    """Return a model that keeps some standard parameters; expressions are their names by default."""
    names = model.mechanism.parameter_names
    chosen = Columns(names, np.arange(len(names))).make_model(kept, values)
    return replace(chosen, expressions=expressions or chosen.names)


def make_reduced_model(
    reduction: Reduction, heuristic: str, row: int, known_values: FloatArray | None = None
) -> ReducedModel:
    """Return a subset as a model with expressions.

    Args:
        reduction: Reduction that holds the subset.
        heuristic: Heuristic that found the subset.
        row: Row of the subset.
        known_values: Standard parameters, (n_standard,), by which the terms of expressions are ordered and negligible terms are
            counted.
    """
    found, columns = reduction.heuristics[heuristic], reduction.columns
    whole = None if known_values is None else np.linalg.pinv(columns.expansion) @ known_values
    kept = np.sort(found.subsets[row])
    beta = compute_lumping(reduction.factor[:, :-1], kept)
    expressions = approximate_expressions(columns.names, kept, beta, whole)
    return replace(reduction.make_model(heuristic, row), expressions=tuple(expressions))


def find_carriers(
    reduction: Reduction, heuristic: str, row: int, known_values: FloatArray
) -> dict[str, str]:
    """Return the parameters that make up most of a lumped value of another name, by the name of the value.

    In a subset of few parameters, the inertia of a lever may stand for that of the chassis that carries the lever.

    Args:
        reduction: Reduction that holds the subset.
        heuristic: Heuristic that found the subset.
        row: Row of the subset.
        known_values: Standard parameters, (n_standard,).
    """
    found, columns = reduction.heuristics[heuristic], reduction.columns
    values = np.linalg.pinv(columns.expansion) @ known_values
    kept = found.subsets[row]
    others = np.setdiff1d(np.arange(len(columns.names)), kept)
    lengths = np.linalg.norm(reduction.factor, axis=0)
    carriers = {}
    beta = compute_lumping(reduction.factor[:, :-1], kept)
    for k, own in zip(kept.tolist(), beta, strict=True):
        parts = np.abs(own * values[others])
        largest = int(parts.argmax()) if parts.size else 0
        known = parts[largest] > _MOSTLY * (parts.sum() + abs(values[k])) if parts.size else False
        if known and parts[largest] * lengths[k] > _NOTHING * lengths[-1]:
            carriers[columns.names[k]] = columns.names[int(others[largest])]
    return carriers
