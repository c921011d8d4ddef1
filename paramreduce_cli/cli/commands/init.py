"""The command that writes a config to begin with."""

import re
from pathlib import Path

import click

from paramreduce_cli.cli.terminal import say
from paramreduce_cli.config.template import dh_template
from paramreduce_cli.errors import ConfigError
from paramreduce_cli.fields.section import NAME


@click.command()
@click.argument("name")
@click.option("--dh", is_flag=True, required=True, help="A Denavit-Hartenberg description.")
@click.option("--joints", type=click.IntRange(1, 30), default=6, show_default=True)
@click.option("--output", type=click.Path(path_type=Path), help="[default: configs/NAME.yaml]")
def init(name: str, dh: bool, joints: int, output: Path | None) -> None:
    """Write a commented config for a new arm.

    Example: paramreduce init --dh my_arm --joints 6
    """
    path = output or Path("configs") / f"{name}.yaml"
    if not re.fullmatch(NAME, name, re.ASCII):
        raise ConfigError(
            f"NAME: {name!r} is no name; start with a letter or digit, go on with those, _, - or dots."
        )
    if path.exists():
        raise ConfigError(f"{path}: exists already; choose another with --output.")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(dh_template(name, joints), encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror}.") from error
    say(f"Wrote {path}. Fill in what is marked TODO, then: paramreduce run {path}")
