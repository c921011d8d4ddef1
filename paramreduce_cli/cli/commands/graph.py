"""The command that tells other tools of the stages."""

import click

from paramreduce_cli.workflow import FORMATS


@click.command()
@click.option("--format", "kind", type=click.Choice(list(FORMATS)), default="text")
def graph(kind: str) -> None:
    """Print the stages with their inputs and outputs, or as rules for Make.

    Example: paramreduce graph --format make > pipelines/stages.mk
    """
    click.echo(FORMATS[kind](), nl=False)
