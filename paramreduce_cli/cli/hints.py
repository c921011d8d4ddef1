"""What to type next, for who has typed something that does not work."""

import difflib
import re
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

import click

from paramreduce_cli.artifacts.places import SUMMARY
from paramreduce_cli.stages import stages

_LEAST_LIKE = 0.5


def meant_command(name: str, known: Sequence[str]) -> str:
    """What is said of a command that there is not."""
    wanted = name.lower().replace("_", "-")
    near = difflib.get_close_matches(wanted, known, n=1, cutoff=_LEAST_LIKE)
    hint = f"did you mean `paramreduce {near[0]}`?" if near else "`paramreduce --help` lists them."
    return (
        f"there is no command {name!r}; {'see `paramreduce --help`.' if wanted == 'help' else hint}"
    )


def next_command(error: click.ClickException) -> str:
    """An example of the command that was called wrongly."""
    context = getattr(error, "ctx", None)
    if context is None or context.parent is None:
        return "paramreduce --help lists all commands; paramreduce alone says what to do next."
    example = re.search(r"Example: (paramreduce .*)", context.command.help or "")
    path = context.command_path.partition(" ")[2]
    more = f"paramreduce {path} --help says more."
    return f"Example: {example[1]}\n{more}" if example else more


def with_arguments(text: str) -> str:
    """A message whose commands can be typed as they stand: with the config and options of this call."""
    given = _own_arguments(sys.argv[1:])

    def completed(found: re.Match[str]) -> str:
        name = found[1]
        return f"`paramreduce {name} {given}`" if name in stages or name == "run" else found[0]

    return re.sub(r"`paramreduce ([a-z-]+)`", completed, text) if given else text


def _own_arguments(words: Sequence[str]) -> str:
    """Of a call the config, and what changes it or says where its results are."""
    kept: list[str] = []
    following = False
    for word in words[1:]:
        if following or word.startswith(("--set=", "--results=", "--samples=")):
            kept.append(word)
            following = False
        elif word in ("--set", "--results", "--samples"):
            kept.append(word)
            following = True
        elif word.endswith((".yaml", ".yml")):
            kept.insert(0, word)
    named = any(word.endswith((".yaml", ".yml")) or word.startswith("--samples") for word in kept)
    return shlex.join(kept) if named else ""


def results_below(folder: Path, command: str) -> str:
    """What may have been meant where a folder holds no results itself; empty if nothing is near."""
    found = sorted(path.parents[1] for path in folder.glob(f"*/{SUMMARY}"))
    return f" Did you mean `paramreduce {command} {shlex.quote(str(found[0]))}`?" if found else ""
