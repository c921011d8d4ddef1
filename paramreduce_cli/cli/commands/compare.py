"""The command that holds one run against another."""

from pathlib import Path

import click

from paramreduce_cli.artifacts.report_files import load_summary
from paramreduce_cli.cli.example_command import ExampleCommand
from paramreduce_cli.cli.terminal import JSON, LOG, emit, say
from paramreduce_cli.errors import ConfigError
from paramreduce_cli.report.summary_comparison import QUANTITIES, TOLERANCES, Tolerance
from paramreduce_cli.report.summary_comparison import compare as compared

DIFFERENT = 1


@click.command(cls=ExampleCommand, example="compare {results} {results_2}")
@click.argument("first", type=click.Path(path_type=Path))
@click.argument("second", type=click.Path(path_type=Path))
@click.option(
    "--tolerance", "given", multiple=True, metavar="QUANTITY=RELATIVE",
    help=f"Relative tolerance of {', '.join(TOLERANCES)}; may be repeated.",
)  # fmt: skip
@click.option(
    "--only", multiple=True, type=click.Choice(list(QUANTITIES)), help="Compare only this."
)
@JSON
@LOG
def compare(
    first: Path, second: Path, given: tuple[str, ...], only: tuple[str, ...], as_json: bool
) -> int:
    """Compare two summaries or results folders; exit code 1 if they differ too much.

    Orders are compared up to ties, trajectories by the best and the median condition number.
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
    except (KeyError, TypeError, IndexError) as error:
        raise ConfigError(
            f"{first} or {second}: is no summary of this version ({error})."
        ) from error
    bad = [d for d in differences if not d.tolerated]
    if as_json:
        emit(agree=not bad, differences=[vars(d) for d in differences])
        return DIFFERENT if bad else 0
    for difference in bad:
        say(f"{difference.what}: {difference.first} -> {difference.second}")
    tolerated = len(differences) - len(bad)
    if bad:
        say(f"{len(bad)} differences beyond tolerance, {tolerated} within.")
        return DIFFERENT
    say(f"{first} and {second} agree: {tolerated} differences, all within tolerance.")
    return 0


def _parse_tolerance(text: str) -> tuple[str, Tolerance]:
    """Return the quantity and the tolerance that NAME=RELATIVE gives."""
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
