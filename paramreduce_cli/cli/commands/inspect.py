"""The command that shows what is in a file."""

from __future__ import annotations

import dataclasses
import itertools
import json
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import rich.markup
import rich.table

from paramreduce_cli.artifacts.folder_layout import SUMMARY
from paramreduce_cli.artifacts.inspection import list_contents
from paramreduce_cli.artifacts.report_files import load_summary, verify_report
from paramreduce_cli.cli.example_command import ExampleCommand
from paramreduce_cli.cli.path_types import ResultsPath
from paramreduce_cli.cli.project_state import list_results_below, make_no_results_error
from paramreduce_cli.cli.terminal import JSON, LOG, emit, escape_controls, out, say, say_table
from paramreduce_cli.errors import ArtifactError, ConfigError, ParamreduceWarning
from paramreduce_cli.records import Identification, Model, ModelChoice, Reduction, Validation
from paramreduce_cli.texts.measured_values import format_measured

if TYPE_CHECKING:
    from paramreduce_cli.records import ReducedModel
    from paramreduce_cli.texts.table import Table


@click.command(cls=ExampleCommand, example="inspect {results} --model selected")
@click.argument("file", type=ResultsPath())
@click.option(
    "--model",
    "chosen",
    metavar="HEURISTIC:N",
    help="Show the parameters of this model, or of the `selected` one.",
)
@click.option(
    "--relations",
    is_flag=True,
    help="Also show the sum of standard parameters that each value is of.",
)
@JSON
@LOG
def inspect(file: Path, chosen: str | None, relations: bool, as_json: bool) -> None:
    """Show the results in an artifact, or the selected model of a results folder.

    FILE is an artifact such as validation.h5, a results folder, or a config. `inspect selected` uses the results in
    this folder if there is only one.
    """
    if str(file) == "selected" and not file.exists():
        file = _find_results()
    folder = file if file.is_dir() else file.parent
    if file.is_dir() and chosen is None:
        if not (file / "validation.h5").exists() and list_results_below(file):
            raise make_no_results_error(file, "inspect")
        chosen = "selected"
    if chosen == "selected":
        title, model = _load_selected(folder / "validation.h5")
        _say_model(title, _list_parameters(model, folder), relations, as_json)
    elif chosen is not None:
        path = file / "reduction.h5" if file.is_dir() else file
        title, model = _load_chosen(path, chosen)
        _say_model(title, _list_parameters(model, folder), relations, as_json)
    elif file.suffix == ".json":
        loaded = load_summary(file)
        if file.name == Path(SUMMARY).name:  # a reference stands alone
            verify_report(file)
        _say_all({**loaded.get("provenance", {}), **loaded.get("selected", {})}, as_json)
    else:
        _say_contents(file, as_json)


def _find_results() -> Path:
    """Return the results folder if there is only one.

    Raises:
        ConfigError: There is no results folder, or more than one.
    """
    found = sorted(path.parent for path in Path("results").glob("*/validation.h5"))
    if len(found) == 1:
        return found[0]
    meant = f"Try `paramreduce inspect {found[0]}`." if found else ""
    raise ConfigError(
        f"selected: there are {len(found)} results folders here.",
        remedy=meant, command="" if found else "run",
    )  # fmt: skip


def _say_all(values: Mapping[str, Any], as_json: bool) -> None:
    """Print values by name."""
    if as_json:
        emit(**values)
        return
    for key, value in values.items():
        say(f"{key}: {value}")


def _say_contents(file: Path, as_json: bool) -> None:
    """Print the main results in a file, then its attributes and datasets."""
    attributes, datasets = list_contents(file)
    results = None if as_json else _make_table(file, attributes.get("stage", ""))
    if results is not None:
        say(results.to_text())
    if as_json:
        keys = ("name", "shape", "content")
        emit(
            attributes=attributes, datasets=[dict(zip(keys, row, strict=True)) for row in datasets]
        )
        return
    _say_all({key: _shorten_attribute(value) for key, value in attributes.items()}, False)
    table = rich.table.Table(box=None, pad_edge=False)
    table.add_column("dataset", no_wrap=True, overflow="ignore")
    table.add_column("shape", no_wrap=True)
    table.add_column("content", overflow="fold")
    for row in _fold_datasets(datasets):
        table.add_row(*(rich.markup.escape(escape_controls(cell)) for cell in row))
    say_table(table, max(len(name) + len(shape) + 20 for name, shape, _ in datasets))


def _make_table(file: Path, stage: str) -> Table | None:
    """Return the main results in an artifact; None if the file is no artifact of this version."""
    from paramreduce_cli.cli.artifact_tables import load_artifact, tabulate_artifact  # slow to load

    try:
        return tabulate_artifact(load_artifact(file, stage), out.width)
    except ArtifactError as error:
        warnings.warn(f"no table: {str(error).rstrip(chr(46))}", ParamreduceWarning, stacklevel=2)
        return None


def _shorten_attribute(text: str) -> str:
    """Return an attribute as text; of digests by name only the names."""
    if not text.startswith("{"):
        return text
    return ", ".join(json.loads(text)) or "none"


def _fold_datasets(datasets: Sequence[tuple[str, str, str]]) -> Iterator[tuple[str, str, str]]:
    """Yield datasets; those that differ by a number alone share a line."""
    for (place, numbered), members in itertools.groupby(datasets, _make_family):
        rows = list(members)
        if not numbered or len(rows) == 1:
            yield from rows
        else:
            numbers = sorted(int(name.rpartition("/")[2]) for name, _, _ in rows)
            yield (
                f"{place}/*",
                f"{len(rows)} datasets",
                f"{rows[0][2]}, {numbers[0]} to {numbers[-1]}",
            )


def _make_family(row: tuple[str, str, str]) -> tuple[str, bool]:
    """Return the folder of a numbered dataset and True, or the path of another dataset and False."""
    place, _, last = row[0].rpartition("/")
    return (place, True) if last.isdecimal() else (row[0], False)


def _say_model(
    title: str, parameters: Sequence[_Parameter], relations: bool, as_json: bool
) -> None:
    """Print the parameters of a model."""
    if as_json:
        emit(model=title, parameters=[dataclasses.asdict(p) for p in parameters])
        return
    say(title)
    longest = max((len(p.name) for p in parameters), default=0)
    for p in parameters:
        if p.deviation is None:
            value = f"{p.value: .5g}"
        else:
            value = " ± ".join(format_measured(p.value, p.deviation))
            value = value if p.value < 0 else f" {value}"
        say(
            f"  {p.name:{longest}}  {value} {p.unit}".rstrip()
            + (f"  =  {p.stands_for}" if relations else "")
        )
    lumped = [p for p in parameters if p.is_lumped]
    if lumped and not relations:
        say(
            f"Values of {len(lumped)} of {len(parameters)} parameters are lumped: {lumped[0].name} is that of "
            f"{lumped[0].stands_for}, not of one body alone. --relations shows all sums."
        )


@dataclasses.dataclass(frozen=True)
class _Parameter:
    """A parameter as it is shown."""

    name: str
    value: float
    unit: str
    """Empty where nothing is known of the robot."""
    deviation: float | None
    """Standard deviation, where torques were measured."""
    stands_for: str
    """Sum of standard parameters that the value is of."""

    @property
    def is_lumped(self) -> bool:
        """Whether the value includes multiples of other parameters."""
        return self.stands_for not in ("", self.name)


def _list_parameters(chosen: ReducedModel, folder: Path) -> list[_Parameter]:
    """Return the parameters of a model, with what the files beside it know of them."""
    model = _load_neighbour(folder / "model.h5", Model)
    found = _load_neighbour(folder / "identification.h5", Identification)
    deviations = {} if found is None else found.reduced.find_deviations(chosen)
    units = [] if model is None else [p.unit for p in model.mechanism.parameters]
    return [
        _Parameter(name, value, units[k] if units else "", deviations.get(name), expression)
        for k, name, value, expression in zip(
            chosen.first, chosen.names, chosen.values.tolist(), chosen.expressions, strict=True
        )
    ]


def _load_selected(file: Path) -> tuple[str, ReducedModel]:
    """Return the selected model and its verdict."""
    from paramreduce_cli.artifacts.store import load_file  # these load all numerics

    validation, _ = load_file(file, Validation, None, "validate")
    selected = validation.selected
    return f"{selected.reason} {validation.verdict}", selected.model


def _load_neighbour(file: Path, record: type) -> Any:
    """Load the record in a file beside the inspected one; return None, with a warning, if it cannot be read."""
    from paramreduce_cli.artifacts.store import load_file  # these load all numerics

    if not file.exists():
        return None
    try:
        return load_file(file, record, None, "")[0]
    except ArtifactError as error:
        warnings.warn(
            f"an artifact beside it is left out: {error}", ParamreduceWarning, stacklevel=2
        )
        return None


def _load_chosen(file: Path, chosen: str) -> tuple[str, ReducedModel]:
    """Return a model of a reduction and its errors."""
    from paramreduce_cli.artifacts.store import load_file  # these load all numerics
    from paramreduce_cli.reduction.models import list_choices, make_reduced_model

    reduction, _ = load_file(file, Reduction, None, "reduce")
    choice = ModelChoice.parse(chosen)
    row = choice.find_row(reduction)
    if row is None:
        choices = list_choices(reduction)
        raise ConfigError(
            f"--model {chosen}: there is {', '.join(choices)}.", rejected=chosen, choices=choices
        )
    found = reduction.heuristics[choice.heuristic]
    known = _load_neighbour(file.parent / "model.h5", Model)
    model = make_reduced_model(
        reduction, choice.heuristic, row, None if known is None else known.values
    )
    flag = ", minimum-norm fit beyond the rank" if found.minimum_norm[row] else ""
    error = f"torque error {found.torque_error[row]:.6g}{flag}"
    return f"{choice.heuristic}, n = {model.n}, {error}", model
