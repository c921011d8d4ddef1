"""The command that tells other tools of the stages."""

from pathlib import Path

import click

from paramreduce_cli.cli.example_command import ExampleCommand
from paramreduce_cli.running.sweep import load_sweep
from paramreduce_cli.running.workflow import FORMATS, format_slurm_script

_SLURM = "slurm"


@click.command(
    cls=ExampleCommand, example="graph --format slurm --sweep pipelines/sweep.yaml > sweep.sh"
)
@click.option("--format", "kind", type=click.Choice([*FORMATS, _SLURM]), default="text")
@click.option(
    "--sweep", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE",
    help="A list of runs, such as pipelines/sweep.yaml; for --format slurm.",
)  # fmt: skip
def graph(kind: str, sweep: Path | None) -> None:
    """Print the stages with their inputs and outputs, as rules for Make, or a list of runs as a script for Slurm."""
    if (kind == _SLURM) != (sweep is not None):
        raise click.UsageError(f"--format {_SLURM} and --sweep FILE go together.")
    text = FORMATS[kind]() if sweep is None else format_slurm_script(load_sweep(sweep))
    click.echo(text, nl=False)
