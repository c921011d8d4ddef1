"""The command that shows what is in a file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import rich.markup
import rich.table

from paramreduce_cli.artifacts.inspection import contents
from paramreduce_cli.artifacts.report_files import load_summary
from paramreduce_cli.cli.hints import results_below
from paramreduce_cli.cli.terminal import JSON, emit, harmless, say, say_table
from paramreduce_cli.errors import ArtifactError, ConfigError
from paramreduce_cli.records import Model, ModelChoice, Reduction, Validation

if TYPE_CHECKING:
    from paramreduce_cli.records import FloatArray, ReducedModel


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--model",
    "chosen",
    metavar="HEURISTIC:N",
    help="Show a model of a reduction.h5, or `selected`.",
)
@click.option("--relations", is_flag=True, help="And what its parameters stand for.")
@JSON
def inspect(file: Path, chosen: str | None, relations: bool, as_json: bool) -> None:
    """Show what is in an artifact and where it came from; of a results folder the selected model.

    Example: paramreduce inspect results/puma560/reduction.h5 --model forward-selection:18
    """
    folder = file if file.is_dir() else file.parent
    if chosen == "selected":
        _say_model(*_selected(folder / "validation.h5"), relations, as_json)
    elif chosen is not None:
        path = file / "reduction.h5" if file.is_dir() else file
        _say_model(*_chosen(path, chosen), relations, as_json)
    elif file.is_dir():
        if not (file / "validation.h5").exists() and (meant := results_below(file, "inspect")):
            raise ArtifactError(f"{file}: holds no results itself.{meant}")
        _say_model(*_selected(file / "validation.h5"), relations, as_json)
    elif file.suffix == ".json":
        loaded = load_summary(file)
        _say_all({**loaded.get("provenance", {}), **loaded.get("selected", {})}, as_json)
    else:
        _say_contents(file, as_json)


def _say_all(found: Mapping[str, Any], as_json: bool) -> None:
    if as_json:
        emit(**found)
        return
    for key, value in found.items():
        say(f"{key}: {value}")


def _say_contents(file: Path, as_json: bool) -> None:
    attributes, datasets = contents(file)
    if as_json:
        keys = ("name", "shape", "content")
        emit(
            attributes=attributes, datasets=[dict(zip(keys, row, strict=True)) for row in datasets]
        )
        return
    _say_all(attributes, False)
    table = rich.table.Table(box=None, pad_edge=False)
    table.add_column("dataset", no_wrap=True)
    table.add_column("shape", no_wrap=True)
    table.add_column("content", overflow="fold")
    for row in datasets:
        table.add_row(*(rich.markup.escape(harmless(cell)) for cell in row))
    say_table(table, max(len(name) + len(shape) + 20 for name, shape, _ in datasets))


def _say_model(title: str, model: ReducedModel, relations: bool, as_json: bool) -> None:
    rows = list(zip(model.names, model.values.tolist(), model.expressions, strict=True))
    if as_json:
        keys = ("name", "value", "stands_for")
        emit(model=title, parameters=[dict(zip(keys, row, strict=True)) for row in rows])
        return
    say(title)
    longest = max(map(len, model.names), default=0)
    for name, value, text in rows:
        say(f"  {name:{longest}}  {value: .9e}" + (f"  =  {text}" if relations else ""))


def _selected(file: Path) -> tuple[str, ReducedModel]:
    """The selected model, and what it is worth."""
    from paramreduce_cli.artifacts.store import load_file  # these load all numerics

    validation, _ = load_file(file, Validation, None, "validate")
    selected = validation.selected
    return f"{selected.reason} {validation.verdict}", selected.model


def _known_values(file: Path) -> FloatArray | None:
    """Standard parameters, by which relations are ordered; None without a model beside the reduction."""
    from paramreduce_cli.artifacts.store import load_file  # these load all numerics

    return load_file(file, Model, None, "build-model")[0].values if file.exists() else None


def _chosen(file: Path, chosen: str) -> tuple[str, ReducedModel]:
    """A model of a reduction, and what it is worth."""
    from paramreduce_cli.artifacts.store import load_file  # these load all numerics
    from paramreduce_cli.reduction.models import known_choices, reduced_model

    reduction, _ = load_file(file, Reduction, None, "reduce")
    choice = ModelChoice.parse(chosen)
    row = choice.row(reduction)
    if row is None:
        raise ConfigError(f"--model {chosen}: there is {known_choices(reduction)}.")
    found = reduction.heuristics[choice.heuristic]
    known = _known_values(file.parent / "model.h5")
    model = reduced_model(reduction, choice.heuristic, row, known)
    flag = ", minimum-norm fit beyond the rank" if found.minimum_norm[row] else ""
    error = f"torque error {found.torque_error[row]:.6g}{flag}"
    return f"{choice.heuristic}, n = {model.n}, {error}", model
