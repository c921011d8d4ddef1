"""The command that describes configs to editors."""

import json

import click

from paramreduce_cli.cli.example_command import ExampleCommand
from paramreduce_cli.config import get_schema


@click.command(cls=ExampleCommand, example="schema > paramreduce.schema.json")
def schema() -> None:
    """Print the JSON Schema of a config, for editors."""
    click.echo(json.dumps(get_schema(), indent=2, default=str))
