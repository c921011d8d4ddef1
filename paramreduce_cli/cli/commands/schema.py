"""The command that describes configs to editors."""

import json

import click

from paramreduce_cli.config import config_schema


@click.command()
def schema() -> None:
    """Print the JSON Schema of a config, for editors.

    Example: paramreduce schema > paramreduce.schema.json
    """
    click.echo(json.dumps(config_schema(), indent=2, default=str))
