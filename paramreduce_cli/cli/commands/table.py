"""The command that sets several robots, or many runs, beside each other."""

from pathlib import Path
from typing import Any

import click

from paramreduce_cli.artifacts.atomic import atomically
from paramreduce_cli.artifacts.places import SUMMARY
from paramreduce_cli.artifacts.report_files import load_summary
from paramreduce_cli.cli.hints import results_below
from paramreduce_cli.cli.terminal import JSON, LOG, emit, say
from paramreduce_cli.errors import ArtifactError, ConfigError
from paramreduce_cli.report.overview import overview, overview_row
from paramreduce_cli.report.spread import choices, run_record, spread
from paramreduce_cli.texts.latex_table import latex_table
from paramreduce_cli.texts.table import Table


@click.command()
@click.argument("results", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--output", type=click.Path(path_type=Path), metavar="PREFIX",
    help="Files are called PREFIX.txt, .csv, .tex and .html.  [default: table, beside the first results]",
)  # fmt: skip
@click.option("--parquet", is_flag=True, help="Write PREFIX-runs.parquet too; it needs pyarrow.")
@JSON
@LOG
def table(results: tuple[Path, ...], output: Path | None, parquet: bool, as_json: bool) -> None:
    """Set one table over several robots or runs, as text, CSV, LaTeX and a page.

    RESULTS are results folders or summaries. Shows the selected model of each robot beside its
    full one; of several runs of a robot how they spread, and which parameters all of them select.
    PREFIX-runs.csv has a row of numbers for every run.

    Example: paramreduce table results/sweep/*/
    """
    rows, records = [], []
    for path in results:
        if path.is_dir() and not (path / SUMMARY).exists():
            raise ArtifactError(
                f"{path}: holds no results itself.{results_below(path, 'table') or ' Make them with `paramreduce run`.'}"
            )
        try:
            summary = load_summary(path)
            rows.append(overview_row(summary))
            records.append(run_record(_name(path), summary))
        except (KeyError, TypeError, ValueError) as error:
            raise ConfigError(f"{path}: is no summary of this version ({error}).") from error
    made = [overview(rows)]
    if len({record["robot"] for record in records}) < len(records):
        made += [spread(records), choices(records)]
    prefix = output or results[0].resolve().parent / "table"
    _write(prefix, made, records)
    if parquet:
        _write_parquet(prefix.with_name(f"{prefix.name}-runs.parquet"), records)
    if as_json:
        emit(runs=records)
        return
    for one in made:
        say(one.to_text())
    say(f"Written to {prefix}.txt, .csv, .tex, .html and {prefix.name}-runs.csv")


def _name(path: Path) -> str:
    """Of a run: its folder's."""
    folder = path.resolve()
    return folder.stem if folder.suffix == ".json" else folder.name


def _write(prefix: Path, made: list[Table], records: list[dict[str, Any]]) -> None:
    from paramreduce_cli.report.page import render_sweep  # Jinja is slow to load

    keys = list(dict.fromkeys(key for record in records for key in record))
    runs = Table(
        "Runs", tuple(keys), tuple(tuple(_cell(one.get(key)) for key in keys) for one in records)
    )
    for ending, text in (
        (".txt", "\n".join(one.to_text() for one in made)),
        (".csv", "\n".join(one.to_csv() for one in made)),
        (".tex", "\n".join(map(latex_table, made))),
        (".html", render_sweep("Reduced models", records, made)),
        ("-runs.csv", runs.to_csv()),
    ):
        with atomically(prefix.with_name(f"{prefix.name}{ending}")) as path:
            path.write_text(text, encoding="utf-8")


def _cell(value: Any) -> str:
    return "" if value is None else str(value)


def _write_parquet(path: Path, records: list[dict[str, Any]]) -> None:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise ConfigError(
            "--parquet: needs pyarrow; install it with `pip install 'paramreduce[parquet]'`, or take the CSV."
        ) from error
    with atomically(path) as temporary:
        pyarrow.parquet.write_table(pyarrow.Table.from_pylist(records), temporary)
