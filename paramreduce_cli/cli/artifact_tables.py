"""Tables of what an artifact holds, for `inspect`: errors by n, condition numbers, values."""

from functools import singledispatch
from pathlib import Path
from typing import Any

import numpy as np

from paramreduce_cli.artifacts.store import load_file
from paramreduce_cli.records import (
    SETS,
    ErrorRange,
    FloatArray,
    Identification,
    IntArray,
    Model,
    Reduction,
    Trajectories,
    Validation,
)
from paramreduce_cli.texts import format_percent
from paramreduce_cli.texts.measured_values import format_measured
from paramreduce_cli.texts.table import Table

_RECORDS: dict[str, type] = {
    "build-model": Model,
    "optimize-trajectories": Trajectories,
    "reduce": Reduction,
    "validate": Validation,
    "identify": Identification,
}
"""Record in the artifact of a stage; the stages themselves are slow to load."""


def load_artifact(file: Path, stage: str) -> Any:
    """Return the record in an artifact, or None if the artifact of the stage has no table."""
    if stage not in _RECORDS:
        return None
    return load_file(file, _RECORDS[stage], None, stage)[0]


@singledispatch
def tabulate_artifact(record: Any, width: int) -> Table | None:
    """Return the main results of a record as a table; None for a record without one.

    Args:
        record: Record of an artifact.
        width: Columns of the terminal; heuristics that do not fit are named in the title.
    """
    return None


@tabulate_artifact.register
def _tabulate_base_parameters(record: Model, width: int) -> Table:
    """Return a table of the base columns: name, body, value and unit."""
    base = [record.mechanism.parameters[k] for k in record.base.columns]
    rows = [
        (p.name, p.owner, f"{record.values[k]:.5g}", p.unit)
        for k, p in zip(record.base.columns, base, strict=True)
    ]
    title = f"{record.values.size} parameters, {int(record.affecting.sum())} act on the torques, {len(rows)} base parameters:"
    return Table(title, ("base column", "body", "value", "unit"), tuple(rows))


@tabulate_artifact.register
def _tabulate_trajectories(record: Trajectories, width: int) -> Table:
    """Return a table of the trajectories: condition number, that of the start, and status."""
    rows = [
        (f"{name} {k}", f"{t.kappa:.4g}", f"{t.kappa_start:.4g}", t.status)
        for name in SETS
        for k, t in enumerate(getattr(record, name), 1)
    ]
    header = ("trajectory", "condition number", "at the start", "status")
    return Table(
        f"Trajectories of {record.period:.4g} s, {record.scaling} condition number",
        header,
        tuple(rows),
    )


@tabulate_artifact.register
def _tabulate_subset_errors(record: Reduction, width: int) -> Table:
    """Return a table of the torque error on the estimation set, by size and heuristic."""
    errors = {name: (found.n, found.torque_error) for name, found in record.heuristics.items()}
    return _tabulate_by_size("Torque error on the estimation set", errors, width)


@tabulate_artifact.register
def _tabulate_validation_errors(record: Validation, width: int) -> Table:
    """Return a table of the torque error on the test set, else on the validation set, by size and heuristic."""
    tested = any(found.torque_error.test.size for found in record.heuristics.values())
    title = "Torque error on the validation set"
    if tested:
        title = "Torque error on the test set, median of its motions"
    errors = {
        name: (
            found.n,
            _summarise_test(found.torque_error.test) if tested else found.torque_error.validation,
        )
        for name, found in record.heuristics.items()
    }
    return _tabulate_by_size(title, errors, width)


@tabulate_artifact.register
def _tabulate_identified_parameters(record: Identification, width: int) -> Table:
    """Return a table of the identified parameters of the payload alone, if there is one, or else of the reduced model:
    value and standard deviation.
    """
    found = record.payload or record.reduced
    rows = [
        (name, *format_measured(value, deviation))
        for name, value, deviation in zip(
            found.names, found.values.tolist(), found.deviations.tolist(), strict=True
        )
    ]
    model = "reduced model" if record.payload is None else "payload alone"
    title = f"Identified parameters of the {model}; {format_percent(found.held_out)} of the held-out torques unexplained"
    return Table(title, ("parameter", "value", "standard deviation"), tuple(rows))


def _summarise_test(errors: FloatArray) -> FloatArray:
    """Return the median over the motions of each model, (m,)."""
    return np.array([ErrorRange.summarise(row).median for row in errors])


def _tabulate_by_size(
    title: str, errors: dict[str, tuple[IntArray, FloatArray]], width: int
) -> Table:
    """Return a table with a row for every number of parameters, and a column for as many heuristics as the width
    allows; the title names the others.
    """
    names = list(errors)
    used, count = 4, 0
    while count < len(names) and used + len(names[count]) + 2 <= width:
        used += len(names[count]) + 2
        count += 1
    shown, rest = names[: max(count, 1)], names[max(count, 1) :]
    values = {
        name: dict(zip(n.tolist(), error.tolist(), strict=True))
        for name, (n, error) in errors.items()
    }
    sizes = sorted({n for name in shown for n in values[name]})
    rows = [
        (str(n), *(format_percent(values[name][n]) if n in values[name] else "" for name in shown))
        for n in sizes
    ]
    more = f". Not shown: {', '.join(rest)}" if rest else ""
    return Table(f"{title}, by number of parameters n{more}", ("n", *shown), tuple(rows))
