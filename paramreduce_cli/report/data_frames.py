"""Records as pandas' tables, for whoever works on with them in Python."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from functools import singledispatch
from typing import TYPE_CHECKING, Any

from paramreduce_cli.records import (
    SETS,
    ErrorRange,
    FloatArray,
    Identification,
    Model,
    ReducedModel,
    Reduction,
    Trajectories,
    Validation,
)

if TYPE_CHECKING:
    import pandas as pd

Row = dict[str, Any]


def make_data_frame(
    record: Model | Trajectories | Reduction | Validation | Identification | ReducedModel,
) -> pd.DataFrame:
    """Return a record as a table of pandas, which must be installed.

    The rows are: of a model its standard parameters (name, body, kind, unit, value, affecting); of trajectories each
    trajectory (set, number, and its figures); of a reduction all subsets (heuristic, n, torque_error, parameters); of a
    validation all subsets (heuristic, n, errors of all joints together, operations); of a reduced model its parameters
    (name, value, stands_for); of an identification the parameters of both models (model, name, value, deviation, which
    is the standard deviation).

    Args:
        record: Record to convert.

    Raises:
        TypeError: No table is made of such a record.
    """
    import pandas as pd

    return pd.DataFrame(list(_list_rows(record)))


@singledispatch
def _list_rows(record: Any) -> Iterator[Row]:
    """Yield the rows of the table of a record, values by the names of the columns; raise TypeError if it has no table."""
    raise TypeError(f"no table is made of a {type(record).__name__}")


@_list_rows.register
def _list_standard_parameters(record: Model) -> Iterator[Row]:
    """Yield a row for each standard parameter."""
    known = zip(
        record.mechanism.parameters, record.values.tolist(), record.affecting.tolist(), strict=True
    )
    for parameter, value, affecting in known:
        yield {"name": parameter.name, "body": parameter.owner, "kind": parameter.kind.symbol,
               "unit": parameter.unit, "value": value, "affecting": affecting}  # fmt: skip


@_list_rows.register
def _list_trajectories(record: Trajectories) -> Iterator[Row]:
    """Yield a row for each trajectory: set, number, and the numbers and texts of its record."""
    for which in SETS:
        for k, trajectory in enumerate(getattr(record, which), 1):
            values = {f.name: getattr(trajectory, f.name) for f in fields(trajectory)}
            numbers = {key: v for key, v in values.items() if isinstance(v, int | float | str)}
            yield {"set": which, "number": k, **numbers}


@_list_rows.register
def _list_subsets(record: Reduction) -> Iterator[Row]:
    """Yield a row for each subset of each heuristic: its size, torque error and columns."""
    for name, found in record.heuristics.items():
        for k, n in enumerate(found.n.tolist()):
            kept = tuple(record.columns.names[c] for c in sorted(found.subsets[k].tolist()))
            error = float(found.torque_error[k])
            yield {"heuristic": name, "n": n, "torque_error": error, "parameters": kept}


@_list_rows.register
def _list_errors(record: Validation) -> Iterator[Row]:
    """Yield a row for each subset of each heuristic: its size, errors, mass matrix and operations."""
    for name, judged in record.heuristics.items():
        columns = {
            "n": judged.n,
            **{f"{what}_error_{which}": judged.get_errors(what)[which]
               for what in ("torque", "acceleration") for which in ("estimation", "validation")},
            **{f"mass_matrix_{key}": values for key, values in vars(judged.mass_matrix).items()},
            **{f"operations_{key}": values for key, values in vars(judged.operations).items()},
        }  # fmt: skip
        for k in range(judged.n.size):
            yield (
                {"heuristic": name}
                | {key: column[k] for key, column in columns.items()}
                | {f"{what}_error_test{end}": value
                   for what in ("torque", "acceleration")
                   for end, value in _summarise_motions(judged.get_errors(what).test[k])}
            )  # fmt: skip


def _summarise_motions(errors: FloatArray) -> Iterator[tuple[str, float]]:
    """Yield median and worst error over the motions of the test set, with the ends of their columns' names."""
    found = ErrorRange.summarise(errors)
    yield from (("", found.median), ("_worst", found.worst))


@_list_rows.register
def _list_model_parameters(record: ReducedModel) -> Iterator[Row]:
    """Yield a row for each parameter of a reduced model: name, value and what is lumped in it."""
    expressions = record.expressions or record.names
    for name, value, text in zip(record.names, record.values.tolist(), expressions, strict=True):
        yield {"name": name, "value": value, "stands_for": text}


@_list_rows.register
def _list_identified_parameters(record: Identification) -> Iterator[Row]:
    """Yield a row for each identified parameter of the full and of the reduced model."""
    for which in ("full", "reduced"):
        found = getattr(record, which)
        columns = (found.names, found.values.tolist(), found.deviations.tolist())
        for name, value, deviation in zip(*columns, strict=True):
            yield {"model": which, "name": name, "value": value, "deviation": deviation}
