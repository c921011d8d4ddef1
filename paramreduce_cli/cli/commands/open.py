"""The command that shows a report in the browser."""

import webbrowser
from pathlib import Path

import click

from paramreduce_cli.artifacts.report_files import list_newer_artifacts, verify_report
from paramreduce_cli.cli.example_command import ExampleCommand
from paramreduce_cli.cli.path_types import ResultsPath
from paramreduce_cli.cli.project_state import make_no_results_error
from paramreduce_cli.cli.terminal import print_error, say


@click.command(cls=ExampleCommand, example="open {results}")
@click.argument("results", type=ResultsPath())
def open(results: Path) -> None:  # the file's name is the command's
    """Open a report in the browser.

    RESULTS is a results folder. If there is no browser, the address is printed.
    """
    folder = results if results.name == "report" else results / "report"
    if not folder.is_dir():
        raise make_no_results_error(results, "open")
    verify_report(folder / "summary.json")
    newer = list_newer_artifacts(folder.parent)
    if newer:
        print_error(
            f"Warning: {' and '.join(newer)} changed since this report was made; `paramreduce run` renews it."
        )
    address = (folder / "index.html").resolve().as_uri()
    say(address)
    if not webbrowser.open(address):
        print_error("Warning: no browser was found; open this address yourself.")
