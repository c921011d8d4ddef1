"""The models that parameters make: the full one, base parameters, and every subset found."""

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

_STIFF = 1e-6
"""Size of a large change of a drive's parameter: much less than that of a body's."""


def known_choices(reduction: Reduction) -> list[str]:
    """List what :class:`ModelChoice` may be, a word for each heuristic; all sizes where groups leave some out."""
    return [
        f"{name}:{f'1...{found.n[-1]}' if found.n[-1] == found.n.size else '|'.join(map(str, found.n))}"
        for name, found in reduction.heuristics.items()
    ]


def full_model(model: Model) -> ReducedModel:
    """All parameters that change the torques."""
    kept = np.flatnonzero(model.affecting)
    return _of_columns(model, kept, model.values[kept])


def base_model(model: Model) -> ReducedModel:
    """The base parameters."""
    return _of_columns(model, model.base.columns, model.base_values, model.base.expressions)


def closest_standard(model: Model, chosen: ReducedModel) -> FloatArray:
    """Standard parameters that are the same model: of all that have its base parameters, those
    closest to the robot's own, each measured by the size of its body.

    Those of drives stay what they are wherever bodies can make up for it.

    Args:
        model: Of the robot.
        chosen: The model.

    Returns:
        (n_parameters,)
    """
    columns, n = model.base.columns, model.values.size
    to_base = np.zeros((columns.size, n))
    to_base[np.arange(columns.size), columns] = 1.0
    to_base[:, np.setdiff1d(np.arange(n), columns)] = model.base.beta
    missing = to_base @ (chosen.standard - model.values)
    sizes = _sizes(model)
    change, *_ = np.linalg.lstsq(to_base * sizes, missing, rcond=None)
    return model.values + sizes * change


def _sizes(model: Model) -> FloatArray:
    """What is a large change of each parameter, (n_parameters,)."""
    sizes = _STIFF * (np.abs(model.values) + 1.0)
    for rigid in model.mechanism.rigid:
        values = {kind: abs(float(model.values[column])) for kind, column in rigid.columns.items()}
        mass = values[Kind.M] or 1.0
        squared = (values[Kind.IXX] + values[Kind.IYY] + values[Kind.IZZ]) / mass or 1e-2
        scales = {Kind.M: mass, **dict.fromkeys((Kind.MX, Kind.MY, Kind.MZ), mass * squared**0.5)}
        for kind, column in rigid.columns.items():
            sizes[column] = scales.get(kind, mass * squared)
    return sizes


def _of_columns(
    model: Model, kept: IntArray, values: FloatArray, expressions: tuple[str, ...] = ()
) -> ReducedModel:
    """A model that keeps standard parameters, which stand for themselves unless more is said."""
    names = model.mechanism.parameter_names
    chosen = Columns(names, np.arange(len(names))).make_model(kept, values)
    return replace(chosen, expressions=expressions or chosen.names)


def reduced_model(
    reduction: Reduction, heuristic: str, row: int, known: FloatArray | None = None
) -> ReducedModel:
    """A subset with its expressions.

    Args:
        reduction: Where it was found.
        heuristic: By which one.
        row: In which it stands.
        known: Standard parameters, (n_standard,), by which terms are ordered and the small ones counted.
    """
    found, columns = reduction.heuristics[heuristic], reduction.columns
    whole = None if known is None else np.linalg.pinv(columns.expansion) @ known
    order = np.argsort(found.subsets[row])
    kept, beta = found.subsets[row][order], found.beta[row][order]
    expressions = approximate_expressions(columns.names, kept, beta, whole)
    return replace(reduction.make_model(heuristic, row), expressions=tuple(expressions))
