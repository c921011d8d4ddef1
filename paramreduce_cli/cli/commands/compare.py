"""The command that holds one run against another."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from paramreduce_cli.artifacts.report_files import load_summary
from paramreduce_cli.cli.example_command import ExampleCommand
from paramreduce_cli.cli.path_types import ResultsPath
from paramreduce_cli.cli.terminal import JSON, LOG, VERBOSE, emit, journal, say
from paramreduce_cli.errors import ConfigError
from paramreduce_cli.report.summary_comparison import QUANTITIES, TOLERANCES, Difference, Tolerance
from paramreduce_cli.report.summary_comparison import compare as compared

DIFFERENT = 1


@click.command(cls=ExampleCommand, example="compare {results} {results_2}")
@click.argument("first", type=ResultsPath())
@click.argument("second", type=ResultsPath())
@click.option(
    "--tolerance", "given", multiple=True, metavar="QUANTITY=RELATIVE",
    help=f"Relative tolerance of {', '.join(TOLERANCES)}; may be repeated.",
)  # fmt: skip
@click.option(
    "--only", multiple=True, type=click.Choice(list(QUANTITIES)), help="Compare only this."
)
@JSON
@VERBOSE
@LOG
def compare(
    first: Path, second: Path, given: tuple[str, ...], only: tuple[str, ...], as_json: bool
) -> int:
    """Compare two summaries or results folders; exit code 1 if they differ too much.

    The command prints the verdict, the selected models and the worst difference of each quantity; --verbose prints all
    differences. Orders are compared up to ties, trajectories by the best and the median condition number.
    """
    summaries = [load_summary(path) for path in (first, second)]
    for path, summary in zip((first, second), summaries, strict=True):
        reduction = summary.get("reduction")
        if not isinstance(reduction, dict) or "proofs" not in reduction:
            raise ConfigError(
                f"{path}: is a summary of an older version.", rejected=str(path), command="run"
            )
    tolerances = {**TOLERANCES, **dict(map(_parse_tolerance, given))}
    try:
        differences = compared(summaries[0], summaries[1], tolerances, only)
        selected = list(dict.fromkeys(map(_describe_selected, summaries)))
    except (KeyError, TypeError, IndexError) as error:
        raise ConfigError(
            f"{first} or {second}: is not a summary of this version ({error})."
        ) from error
    bad = [d for d in differences if not d.tolerated]
    if as_json:
        emit(agree=not bad, differences=[vars(d) for d in differences])
        return DIFFERENT if bad else 0
    within = len(differences) - len(bad)
    if bad:
        say(
            f"{first} and {second} differ: {len(bad)} differences beyond tolerance, {within} within."
        )
    else:
        say(f"{first} and {second} agree: {within} differences, all within tolerance.")
    say(f"Selected: {' -> '.join(selected)}")
    for quantity in QUANTITIES:
        _say_quantity(quantity, [d for d in bad if d.quantity == quantity])
    return DIFFERENT if bad else 0


def _describe_selected(summary: dict[str, Any]) -> str:
    """Return heuristic, size and verdict of the selected model."""
    selected = summary["selected"]
    accepted = {True: ", accepted", False: ", not accepted", None: ""}[selected["accepted"]]
    return f"{selected['heuristic']} with {selected['n']} parameters{accepted}"


def _say_quantity(quantity: str, bad: Sequence[Difference]) -> None:
    """Print the worst difference of a quantity, or with --verbose all differences."""
    if not bad:
        return
    worst = max(bad, key=lambda difference: difference.size)
    rest = f" ({len(bad) - 1} more, see --verbose)" if len(bad) > 1 and not journal.verbose else ""
    for difference in bad if journal.verbose else [worst]:
        say(f"{quantity}: {difference.what}: {difference.first} -> {difference.second}{rest}")


def _parse_tolerance(text: str) -> tuple[str, Tolerance]:
    """Return the quantity and the tolerance that NAME=RELATIVE gives.

    Raises:
        ConfigError: The text has another form, the quantity is unknown, or the number is negative.
    """
    name, _, value = text.partition("=")
    try:
        relative, absolute = float(value), TOLERANCES[name].absolute
        if not relative >= 0:
            raise ValueError
        return name, Tolerance(relative, absolute)
    except (KeyError, ValueError) as error:
        raise ConfigError(
            f"--tolerance {text}: write QUANTITY=NUMBER, of 0 or more, with one of {', '.join(TOLERANCES)}."
        ) from error
