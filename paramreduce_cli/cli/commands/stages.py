"""The command that lists the stages of a run."""

from pathlib import Path

import click

from paramreduce_cli.artifacts.store import get_file
from paramreduce_cli.cli.example_command import ExampleCommand
from paramreduce_cli.cli.options import CONFIG, SET
from paramreduce_cli.config import load_config
from paramreduce_cli.running.pipeline import list_stages_to_run


@click.command(
    cls=ExampleCommand, example="stages {config}", context_settings={"ignore_unknown_options": True}
)
@CONFIG
@SET
@click.argument("others", nargs=-1, type=click.UNPROCESSED, metavar="")
def stages(config: Path, overrides: tuple[str, ...], others: tuple[str, ...]) -> None:
    """List the stages that a run of a config has, in order, with the file that each makes.

    Options of other commands are ignored, so that Make can ask with the options of a run.
    """
    for stage in list_stages_to_run(load_config(config, overrides)):
        click.echo(f"{stage.name} {get_file(stage.output)}")
