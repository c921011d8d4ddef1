"""The command that teaches a shell the names of commands and options."""

from pathlib import Path

import click
from click.shell_completion import get_completion_class

from paramreduce_cli.artifacts.atomic import replace_atomically
from paramreduce_cli.cli.example_command import ExampleCommand
from paramreduce_cli.cli.terminal import say

_PLACES = {
    "bash": ".local/share/bash-completion/completions/paramreduce",
    "zsh": ".zfunc/_paramreduce",
    "fish": ".config/fish/completions/paramreduce.fish",
}
"""Where shells look, below the home folder."""


@click.command(cls=ExampleCommand, example="completion bash --install")
@click.argument("shell", type=click.Choice(list(_PLACES)))
@click.option("--install", is_flag=True, help="Write it to where the shell looks.")
def completion(shell: str, install: bool) -> None:
    """Print the completion script of a shell, or install it."""
    made = get_completion_class(shell)
    assert made is not None  # the shells are those that click knows
    root = click.get_current_context().find_root().command
    text = made(root, {}, "paramreduce", "_PARAMREDUCE_COMPLETE").source()
    if not install:
        click.echo(text)
        return
    path = Path.home() / _PLACES[shell]
    with replace_atomically(path) as file:
        file.write_text(text, encoding="utf-8")
    more = "; have fpath+=~/.zfunc before compinit in ~/.zshrc" if shell == "zsh" else ""
    say(f"Wrote {path}: new shells know it{more}.")
