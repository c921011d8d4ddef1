"""The command that sets several robots, or many runs, beside each other."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from paramreduce_cli.artifacts.atomic import replace_atomically
from paramreduce_cli.artifacts.folder_layout import SUMMARY
from paramreduce_cli.artifacts.report_files import load_summary
from paramreduce_cli.cli.example_command import ExampleCommand
from paramreduce_cli.cli.path_types import ResultsPath
from paramreduce_cli.cli.project_state import make_no_results_error
from paramreduce_cli.cli.terminal import JSON, LOG, emit, say, warn_user
from paramreduce_cli.errors import ArtifactError, ConfigError
from paramreduce_cli.report.overview import make_overview, make_overview_row
from paramreduce_cli.report.spread import make_run_record, tabulate_choices, tabulate_spread
from paramreduce_cli.running.sweep import Sweep, load_sweep
from paramreduce_cli.texts.latex_table import format_latex_table
from paramreduce_cli.texts.table import Table

_MOST_NAMED = 12


@click.command(cls=ExampleCommand, example="table {results}")
@click.argument("results", nargs=-1, type=ResultsPath())
@click.option(
    "--sweep", "listed", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE",
    help="A list of runs, such as pipelines/sweep.yaml: all of them that have ended, with their seeds and variants.",
)  # fmt: skip
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), metavar="PREFIX",
    help="Files are called PREFIX.txt, .csv, .tex and .html.  [default: table, beside the first results]",
)  # fmt: skip
@click.option("--parquet", is_flag=True, help="Write PREFIX-runs.parquet too; it needs pyarrow.")
@JSON
@LOG
def table(
    results: tuple[Path, ...],
    listed: Path | None,
    output: Path | None,
    parquet: bool,
    as_json: bool,
) -> None:
    """Make one table of several robots or runs, as text, CSV, LaTeX and a page.

    RESULTS are results folders or summaries. The table shows the selected model of each robot beside the full one. For
    several runs of a robot it shows how results vary, and which parameters all runs select. PREFIX-runs.csv has a row
    of numbers for every run.
    """
    if (listed is not None) == bool(results):
        raise click.UsageError("Give RESULTS, or --sweep FILE.")
    if listed is not None:
        sweep = load_sweep(listed)
        labels, folder = _list_finished(listed, sweep), sweep.folder
    else:
        labels, folder = {path: {} for path in results}, results[0].resolve().parent
    summaries = {path: _load_summary(path) for path in labels}
    robots = Counter(summary.get("robot") for summary in summaries.values())
    rows, records = [], []
    for path, summary in summaries.items():
        name = _name_run(path)
        try:
            rows.append(make_overview_row(summary, name if robots[summary["robot"]] > 1 else ""))
            records.append(make_run_record(name, summary, **labels[path]))
        except (KeyError, TypeError, ValueError) as error:
            raise ConfigError(f"{path}: is not a summary of this version ({error}).") from error
    made = {"": make_overview(rows)}
    if len(robots) < len(records):
        made |= {"-spread": tabulate_spread(records), "-choices": tabulate_choices(records)}
    prefix = output or folder / "table"
    _write(prefix, made, records)
    if parquet:
        _write_parquet(prefix.with_name(f"{prefix.name}-runs.parquet"), records)
    if as_json:
        emit(runs=records)
        return
    for one in made.values():
        say(one.to_text())
    tables = ", ".join(f"{prefix.name}{part}.csv" for part in [*made, "-runs"])
    tables += f", {prefix.name}-runs.parquet" if parquet else ""
    say(f"Written to {prefix}.txt, .tex and .html, and {tables}")


def _list_finished(listed: Path, sweep: Sweep) -> dict[Path, dict[str, Any]]:
    """Return the folders of the finished runs, with their variants and seeds; report the others.

    Raises:
        ArtifactError: No run has finished.
    """
    ended = {
        run.folder: {"variant": run.variant, "seed": run.seed}
        for run in sweep.runs.values()
        if (run.folder / SUMMARY).exists()
    }
    left = [name for name, run in sweep.runs.items() if run.folder not in ended]
    if not ended:
        raise ArtifactError(f"{listed}: none of its {len(left)} runs is finished.")
    if left:
        more = f" and {len(left) - _MOST_NAMED} more" if len(left) > _MOST_NAMED else ""
        warn_user(f"unfinished runs are left out: {', '.join(left[:_MOST_NAMED])}{more}")
    return ended


def _load_summary(path: Path) -> dict[str, Any]:
    """Return the summary in a results folder or in a file.

    Raises:
        ArtifactError: There is no report, or the file is missing, damaged or no summary.
        ConfigError: There is no report, or the file is no summary.
    """
    if path.is_dir() and not (path / SUMMARY).exists():
        raise make_no_results_error(path, "table")
    return load_summary(path)


def _name_run(path: Path) -> str:
    """Return the name of a run, which is the name of its folder."""
    folder = path.resolve()
    return folder.stem if folder.suffix == ".json" else folder.name


def _write(prefix: Path, made: Mapping[str, Table], records: list[dict[str, Any]]) -> None:
    # Jinja and matplotlib are slow to load.
    """Write tables, rows and the page with a prefix."""
    from paramreduce_cli.report.page import render_sweep
    from paramreduce_cli.report.runs_figure import draw_runs
    from paramreduce_cli.report.style import render

    keys = list(dict.fromkeys(key for record in records for key in record))
    runs = Table(
        "Runs",
        tuple(keys),
        tuple(tuple(_format_cell(one.get(key)) for key in keys) for one in records),
    )
    tables = list(made.values())
    figure = render(draw_runs, records, ["svg"])["svg"]
    for ending, text in {
        ".txt": "\n".join(one.to_text() for one in tables),
        ".tex": "\n".join(map(format_latex_table, tables)),
        ".html": render_sweep("Reduced models", records, tables, figure),
        **{f"{part}.csv": one.to_csv() for part, one in made.items()},
        "-runs.csv": runs.to_csv(),
    }.items():
        with replace_atomically(prefix.with_name(f"{prefix.name}{ending}")) as path:
            path.write_text(text, encoding="utf-8")


def _format_cell(value: Any) -> str:
    return "" if value is None else str(value)


def _write_parquet(path: Path, records: list[dict[str, Any]]) -> None:
    """Write the rows of all runs as Parquet.

    Raises:
        ConfigError: pyarrow is not installed.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise ConfigError(
            "--parquet: needs pyarrow.",
            remedy="Install it with `pip install 'paramreduce[parquet]'`, or take the CSV.",
        ) from error
    with replace_atomically(path) as temporary:
        pyarrow.parquet.write_table(pyarrow.Table.from_pylist(records), temporary)
