"""The command that sets several robots beside each other."""

from pathlib import Path

import click

from paramreduce_cli.artifacts.atomic import atomically
from paramreduce_cli.artifacts.report_files import load_summary
from paramreduce_cli.cli.terminal import say
from paramreduce_cli.errors import ConfigError
from paramreduce_cli.report.overview import overview, overview_row


@click.command()
@click.argument("results", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--output", type=click.Path(path_type=Path), metavar="PREFIX",
    help="Files are called PREFIX.txt, .csv and .tex.  [default: table, beside the first results]",
)  # fmt: skip
def table(results: tuple[Path, ...], output: Path | None) -> None:
    """Set one table over several robots, as text, CSV and LaTeX.

    RESULTS are results folders or summaries. Shows the selected model of each robot beside its
    full one.

    Example: paramreduce table results/puma560 results/hexaglide
    """
    rows = []
    for path in results:
        try:
            rows.append(overview_row(load_summary(path)))
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
