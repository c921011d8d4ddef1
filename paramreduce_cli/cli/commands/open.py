"""The command that shows a report in the browser."""

import webbrowser
from pathlib import Path

import click

from paramreduce_cli.artifacts.report_files import newer_than_report, verify_report
from paramreduce_cli.cli.hints import results_below
from paramreduce_cli.cli.terminal import complain, say
from paramreduce_cli.errors import ArtifactError


@click.command()
@click.argument("results", type=click.Path(path_type=Path))
def open(results: Path) -> None:  # the file's name is the command's
    """Open a report in the browser.

    RESULTS is a results folder. Where there is no browser the address is printed.

    Example: paramreduce open results/puma560
    """
    folder = results if results.name == "report" else results / "report"
    if not folder.is_dir():
        meant = results_below(results, "open")
        raise ArtifactError(
            f"{folder}: is not there.{meant or ' Make it with `paramreduce run CONFIG`.'}"
        )
    verify_report(folder / "summary.json")
    newer = newer_than_report(folder.parent)
    if newer:
        complain(
            f"Warning: {' and '.join(newer)} changed since this report was made; `paramreduce run` renews it."
        )
    address = (folder / "index.html").resolve().as_uri()
    say(address)
    if not webbrowser.open(address):
        complain("Warning: no browser was found; open this address yourself.")
