"""Commands that look at files or write new ones: no stage is run here."""

import json
import re
from pathlib import Path
from typing import Any

import click
import rich.markup
import rich.table

from paramreduce_cli.artifacts.atomic import atomically
from paramreduce_cli.artifacts.inspection import contents
from paramreduce_cli.artifacts.report_files import load_json
from paramreduce_cli.artifacts.store import Store, load_file
from paramreduce_cli.cli.terminal import out, say
from paramreduce_cli.config import config_schema
from paramreduce_cli.config.template import dh_template
from paramreduce_cli.errors import ConfigError
from paramreduce_cli.fields.section import NAME
from paramreduce_cli.records import ModelChoice, Reduction, Report
from paramreduce_cli.reduction.models import known_choices, reduced_model
from paramreduce_cli.report.comparison import QUANTITIES, TOLERANCES, Difference, Tolerance, compare
from paramreduce_cli.report.overview import overview, overview_row
from paramreduce_cli.workflow import FORMATS

DIFFERENT = 1


@click.command()
def schema() -> None:
    """Print the JSON Schema of a config, for editors.

    Example: paramreduce schema > paramreduce.schema.json
    """
    click.echo(json.dumps(config_schema(), indent=2, default=str))


@click.command()
@click.argument("name")
@click.option("--dh", is_flag=True, required=True, help="A Denavit-Hartenberg description.")
@click.option("--joints", type=click.IntRange(1, 30), default=6, show_default=True)
@click.option("--output", type=click.Path(path_type=Path), help="[default: configs/NAME.yaml]")
def init(name: str, dh: bool, joints: int, output: Path | None) -> None:
    """Write a commented config for a new arm.

    Example: paramreduce init --dh my_arm --joints 6
    """
    path = output or Path("configs") / f"{name}.yaml"
    if not re.fullmatch(NAME, name, re.ASCII):
        raise ConfigError(
            f"NAME: {name!r} is no name; start with a letter or digit, go on with those, _, - or dots."
        )
    if path.exists():
        raise ConfigError(f"{path}: exists already; choose another with --output.")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(dh_template(name, joints), encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror}.") from error
    say(f"Wrote {path}. Fill in what is marked TODO, then: paramreduce run {path}")


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--model", "chosen", metavar="HEURISTIC:N", help="Show a model of a reduction.h5.")
def inspect(file: Path, chosen: str | None) -> None:
    """Show what is in an artifact and where it came from.

    Example: paramreduce inspect results/puma560/reduction.h5 --model forward-selection:18
    """
    if chosen is not None:
        _say_model(file, chosen)
        return
    if file.suffix == ".json":
        loaded = _load_summary(file)
        for key, value in {**loaded.get("provenance", {}), **loaded.get("selected", {})}.items():
            say(f"{key}: {value}")
        return
    attributes, datasets = contents(file)
    for name, value in attributes.items():
        say(f"{name}: {value}")
    table = rich.table.Table(box=None, pad_edge=False)
    for heading in ("dataset", "shape", "content"):
        table.add_column(heading, overflow="fold")
    for row in datasets:
        table.add_row(*(rich.markup.escape(cell) for cell in row))
    out.print(table)


def _say_model(file: Path, chosen: str) -> None:
    reduction, _ = load_file(file, Reduction, None, "reduce")
    choice = ModelChoice.parse(chosen)
    row = choice.row(reduction)
    if row is None:
        raise ConfigError(f"--model {chosen}: there is {known_choices(reduction)}.")
    found = reduction.heuristics[choice.heuristic]
    model = reduced_model(reduction, choice.heuristic, row)
    flag = ", minimum-norm fit beyond the rank" if found.minimum_norm[row] else ""
    say(f"{choice.heuristic}, n = {model.n}, torque error {found.torque_error[row]:.6g}{flag}")
    for value, text in zip(model.values, model.expressions, strict=True):
        say(f"{value: .9e}  =  {text}")


@click.command(name="compare")
@click.argument("first", type=click.Path(path_type=Path))
@click.argument("second", type=click.Path(path_type=Path))
@click.option(
    "--tolerance", "given", multiple=True, metavar="QUANTITY=RELATIVE",
    help=f"Relative tolerance of {', '.join(TOLERANCES)}; may be repeated.",
)  # fmt: skip
@click.option(
    "--only", multiple=True, type=click.Choice(list(QUANTITIES)), help="Compare only this."
)
def compare_command(
    first: Path, second: Path, given: tuple[str, ...], only: tuple[str, ...]
) -> int:
    """Compare two summaries or results folders; exit code 1 if they differ too much.

    Orders are compared up to ties, trajectories by the best and the median condition number.

    Example: paramreduce compare results/reference/puma560.json results/puma560
    """
    summaries = [_load_summary(path) for path in (first, second)]
    for path, summary in zip((first, second), summaries, strict=True):
        if "proofs" not in summary.get("reduction", {}):
            raise ConfigError(
                f"{path}: is a summary of an older version; make it again with `paramreduce run`."
            )
    tolerances = {**TOLERANCES, **dict(map(_tolerance, given))}
    try:
        differences = compare(summaries[0], summaries[1], tolerances, only)
    except (KeyError, TypeError, IndexError) as error:
        raise ConfigError(
            f"{first} or {second}: is no summary of this version ({error})."
        ) from error
    bad = [d for d in differences if not d.tolerated]
    for difference in bad:
        say(_difference_text(difference))
    tolerated = len(differences) - len(bad)
    if bad:
        say(f"{len(bad)} differences beyond tolerance, {tolerated} within.")
        return DIFFERENT
    say(f"{first} and {second} agree: {tolerated} differences, all within tolerance.")
    return 0


def _difference_text(d: Difference) -> str:
    return f"{d.what}: {d.first} -> {d.second}"


def _tolerance(text: str) -> tuple[str, Tolerance]:
    name, _, value = text.partition("=")
    try:
        return name, Tolerance(float(value), TOLERANCES[name].absolute)
    except (KeyError, ValueError) as error:
        raise ConfigError(
            f"--tolerance {text}: write QUANTITY=NUMBER with one of {', '.join(TOLERANCES)}."
        ) from error


def _load_summary(path: Path) -> dict[str, Any]:
    if path.is_dir():
        path = Store(path).path(Report)
    loaded = load_json(path)
    if not isinstance(loaded, dict):
        raise ConfigError(f"{path}: is no summary.json.")
    return loaded


@click.command(name="table")
@click.argument("results", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--output", type=click.Path(path_type=Path), metavar="PREFIX",
    help="Files are called PREFIX.txt, .csv and .tex.  [default: table, beside the first results]",
)  # fmt: skip
def table_command(results: tuple[Path, ...], output: Path | None) -> None:
    """Set one table over several robots, as text, CSV and LaTeX.

    RESULTS are results folders or summaries. Shows the selected model of each robot beside its
    full one.

    Example: paramreduce table results/puma560 results/hexaglide
    """
    rows = []
    for path in results:
        try:
            rows.append(overview_row(_load_summary(path)))
        except (KeyError, TypeError, ValueError) as error:
            raise ConfigError(f"{path}: is no summary of this version ({error}).") from error
    made = overview(rows)
    prefix = output or results[0].resolve().parent / "table"
    for suffix, text in (
        ("txt", made.to_text()), ("csv", made.to_csv()), ("tex", made.to_latex()),
    ):  # fmt: skip
        with atomically(prefix.with_name(f"{prefix.name}.{suffix}")) as path:
            path.write_text(text, encoding="utf-8")
    say(made.to_text())
    say(f"Written to {prefix}.txt, .csv and .tex")


@click.command()
@click.option("--format", "kind", type=click.Choice(list(FORMATS)), default="text")
def graph(kind: str) -> None:
    """Print the stages with their inputs and outputs, or as rules for Make.

    Example: paramreduce graph --format make > pipelines/stages.mk
    """
    click.echo(FORMATS[kind](), nl=False)
