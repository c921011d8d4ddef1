"""The models that parameters make: the full one, base parameters, and every subset found."""

from dataclasses import replace

import numpy as np

from paramreduce_cli.multibody.relations import approximate_expressions
from paramreduce_cli.records import Columns, FloatArray, IntArray, Model, ReducedModel, Reduction


def known_choices(reduction: Reduction) -> str:
    """What :class:`ModelChoice` may be, for messages; all sizes where groups leave some out."""
    return ", ".join(
        f"{name}:{f'1...{found.n[-1]}' if found.n[-1] == found.n.size else '|'.join(map(str, found.n))}"
        for name, found in reduction.heuristics.items()
    )


def full_model(model: Model) -> ReducedModel:
    """All parameters that change the torques."""
    kept = np.flatnonzero(model.affecting)
    return _of_columns(model, kept, model.values[kept])


def base_model(model: Model) -> ReducedModel:
    """The base parameters."""
    return _of_columns(model, model.base.columns, model.base_values, model.base.expressions)


def _of_columns(
    model: Model, kept: IntArray, values: FloatArray, expressions: tuple[str, ...] = ()
) -> ReducedModel:
    """A model that keeps standard parameters, which stand for themselves unless more is said."""
    names = model.mechanism.parameter_names
    chosen = Columns(names, np.arange(len(names))).model(kept, values)
    return replace(chosen, expressions=expressions or chosen.names)


def reduced_model(
    reduction: Reduction, heuristic: str, row: int, known: FloatArray | None = None
) -> ReducedModel:
    """A subset with its expressions.

    Args:
        reduction: Where it was found.
        heuristic: By which one.
        row: In which it stands.
        known: Standard parameters, (n_standard,); terms that do not show beside them are left out.
    """
    found, columns = reduction.heuristics[heuristic], reduction.columns
    whole = None if known is None else np.linalg.pinv(columns.expansion) @ known
    expressions = approximate_expressions(columns.names, found.subsets[row], found.beta[row], whole)
    return replace(reduction.model(heuristic, row), expressions=tuple(expressions))
