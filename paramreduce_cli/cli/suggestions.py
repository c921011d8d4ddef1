"""Suggestions of what to type after a command line that fails, from the error and the folder."""

import difflib
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import click

from paramreduce_cli.cli.example_command import ExampleCommand
from paramreduce_cli.cli.project_state import (
    find_project_above,
    guess_config,
    guess_results,
    list_configs,
)
from paramreduce_cli.errors import ConfigError, MissingConfigError, ParamreduceError
from paramreduce_cli.stages import stages

_OF_CONFIGS = ("run", "stages", "export", "export-trajectory")
"""Commands that take a config, beside the stages."""
_OF_RESULTS = ("open", "inspect", "table")
"""Commands that take results."""
_LIKE_ROBOT, _LIKE_COMMAND, _LIKE_OPTION = 0.8, 0.6, 0.75
"""How alike a name must be to the one that is suggested."""
_RANGE, _OR = "...", "|"
"""Marks between the numbers of choices: ``swap:1...7`` has all from 1 to 7, ``swap:2|4`` those two."""


@dataclass(frozen=True)
class CommandLine:
    """A parsed command line."""

    words: Sequence[str]
    """Words after ``paramreduce``."""
    command: click.Command | None
    """The command; None where there is no such command."""


class UnknownCommandError(click.UsageError):
    """An error about a command that does not exist.

    Args:
        name: Name that was typed.
        commands: Names of the commands.
        context: Context of the program.
    """

    def __init__(self, name: str, commands: Sequence[str], context: click.Context) -> None:
        self.name = name
        typed = name.lower().replace("_", "-")
        near = difflib.get_close_matches(typed, commands, n=1, cutoff=_LIKE_COMMAND)
        hint = "`paramreduce --help` lists them."
        if typed in ("version", "help"):
            hint = f"see `paramreduce --{typed}`."
        elif near:
            hint = f"Did you mean `paramreduce {near[0]}`?"
        super().__init__(f"there is no command {name!r}; {hint}", context)


def describe_error(error: ParamreduceError, call: CommandLine) -> str:
    """Return the message of an error, whose commands have the arguments of the command line."""
    return error.describe(
        _keep_config_arguments(call.words) or _guess_config(error.rejected) or "CONFIG"
    )


def suggest_after_error(error: ParamreduceError, call: CommandLine) -> str:
    """Return lines that say what to type next; empty where the error says it."""
    words = list(call.words)
    if not words:
        return show_example(call)
    if meant := _suggest_other_place(error, words):
        return f"Next: {meant}"
    if error.command or error.remedy:
        return ""
    corrected = _correct_call(error, words)
    if corrected is None:
        return show_example(call)
    return f"{'Then again' if corrected == words else 'Next'}: {_format_call(corrected)}"


def suggest_after_usage_error(error: click.ClickException, call: CommandLine) -> str:
    """Return lines that say what to type after a command line that click rejects."""
    words = list(call.words)
    meant = ""
    if isinstance(error, click.NoSuchOption) and call.command is not None:
        option = _find_option(error.option_name, call.command, words)
        changed = [_replace_option(word, error.option_name, option) for word in words if option]
        meant = _format_call(changed) if option else ""
    elif isinstance(error, click.MissingParameter) and _is_config(error.param):
        meant = _insert_config(words)
    elif isinstance(error, UnknownCommandError):
        meant = _suggest_meant_place(error.name, words)
    elif rejected := getattr(error, "rejected", ""):
        meant = _suggest_meant_place(rejected, words)
    return f"Next: {meant}" if meant else show_example(call)


def describe_usage_error(error: click.ClickException) -> str:
    """Return the message of a command line that click rejects; click guesses options by their spelling alone."""
    if isinstance(error, click.NoSuchOption) and error.ctx and error.ctx.parent:
        return f"there is no option {error.option_name}."
    return error.format_message()


def show_example(call: CommandLine) -> str:
    """Return an example of the command with what is in this folder, and where to read more."""
    command = call.command
    if command is None:
        return "paramreduce --help lists all commands; paramreduce alone says what to do next."
    more = f"paramreduce {command.name} --help says more."
    example = command.show_example(call.words) if isinstance(command, ExampleCommand) else ""
    return f"Example: {example}\n{more}" if example else more


def _is_config(parameter: click.Parameter | None) -> bool:
    return parameter is not None and parameter.name == "config"


def _format_call(words: Sequence[str]) -> str:
    return shlex.join(["paramreduce", *words])


def _insert_config(words: Sequence[str]) -> str:
    """Return the command line with the first config here; empty where there is none, or samples are given."""
    here = list_configs(Path())
    if not here or any(word.startswith("--samples") for word in words):
        return ""
    return _format_call([words[0], str(here[0]), *words[1:]])


def _suggest_other_place(error: ParamreduceError, words: list[str]) -> str:
    """Return the command line with what the user means by a path or a name that is rejected."""
    if isinstance(error, MissingConfigError):
        return _insert_config(words)
    if words[0] == "init" and len(words) == 2:
        return _suggest_example(words[1])
    known = error.choices or error.options
    return "" if known or not error.rejected else _suggest_meant_place(error.rejected, words)


def _suggest_meant_place(rejected: str, words: list[str]) -> str:
    """Return the command line with the config, the results or the folder that a typed word stands for."""
    word = next((w for w in words if rejected in (w, w.rstrip("/"))), None)
    if word is None:
        return ""
    above = find_project_above(Path())
    if above is not None and not Path(word).exists() and (above / word).exists():
        return f"cd {above} && {_format_call(words)}"
    for meant in (_replace_by_other_kind(word, words), _correct_robot_name(word, words)):
        if meant is not None:
            return _format_call(meant) if meant != words else ""
    return _suggest_example(word) if guess_config(word) is None else ""


def _replace_by_other_kind(word: str, words: list[str]) -> list[str] | None:
    """Return the command line with a config for results, or results for a config, or a robot's name; None if there is no such
    file.
    """
    config, results = guess_config(word), guess_results(word)
    if word == words[0]:
        return None if config is None or len(words) > 1 else ["run", str(config)]
    if words[0] in (*stages, *_OF_CONFIGS):
        return None if config is None else _replace_word(words, word, str(config))
    if words[0] not in _OF_RESULTS:
        return None
    if results is not None and results.resolve() != Path(word).resolve():
        return _replace_word(words, word, str(results))
    return None if config is None else ["run", str(config)]


def _correct_robot_name(word: str, words: list[str]) -> list[str] | None:
    """Return the command line with the config whose name is like a robot's name that was typed, or None."""
    if words[0] not in (*stages, *_OF_CONFIGS) or Path(word).name != word or Path(word).suffix:
        return None
    here = {path.stem: path for path in list_configs(Path())}
    near = difflib.get_close_matches(word, here, n=1, cutoff=_LIKE_ROBOT)
    return _replace_word(words, word, str(here[near[0]])) if near else None


def _suggest_example(word: str) -> str:
    """Return the command line that copies the example of a robot's name; empty where there is none."""
    from paramreduce_cli.config.examples import list_examples  # late: it loads much

    name = Path(word).name.removesuffix(".yaml")
    return _format_call(["init", "--example", name]) if name in list_examples() else ""


def _correct_call(error: ParamreduceError, words: list[str]) -> list[str] | None:
    """Return the command line with a choice or an option of the error; None where the error has none."""
    if error.choices:
        return _replace_word(
            words, error.rejected, find_nearest_choice(error.rejected, error.choices)
        )
    if error.options:
        return _replace_word(words, error.rejected, error.options[-1]) or [*words, *error.options]
    if error.rejected.startswith("results/") and (config := guess_config(error.rejected)):
        return ["run", str(config)]
    return words if isinstance(error, ConfigError) and error.in_file else None


def find_nearest_choice(rejected: str, choices: Sequence[str]) -> str:
    """Return the choice most like a rejected word, with a number in range where the choices have numbers.

    Args:
        rejected: Word that was typed, such as ``swop:9`` or ``9``.
        choices: Words such as ``full``, ``swap:1...7`` or ``swap:2|4|6``. A choice with a single number, such as
            ``swap:4``, is the default if another choice has the same name.
    """
    names = [choice.partition(":")[0] for choice in choices]
    default = next(
        (c for c, name in zip(choices, names, strict=True)
         if c.partition(":")[2].isdecimal() and names.count(name) > 1),
        "",
    )  # fmt: skip
    others = [choice for choice in choices if choice != default]
    name, _, number = rejected.partition(":")
    digits = "".join(c for c in rejected.lstrip(":") if c.isdecimal())
    if digits and not name.strip(digits):
        numbered = [choice.partition(":")[0] for choice in others if ":" in choice]
        name, number = default.partition(":")[0] or (numbered or others)[0], digits
    completions = [choice for choice in others if choice.partition(":")[0].startswith(name)]
    near = completions or difflib.get_close_matches(name, others or choices, n=1, cutoff=0.0)
    return _limit_to_range(near[0], number or default.partition(":")[2])


def _limit_to_range(choice: str, number: str) -> str:
    """Return ``swap:1...7`` or ``swap:2|4|6`` with the nearest number that it has."""
    name, _, numbers = choice.partition(":")
    first, dots, last = numbers.partition(_RANGE)
    listed = [first, last] if dots else numbers.split(_OR)
    if not all(one.isdecimal() for one in listed):
        return choice
    known = range(int(first), int(last) + 1) if dots else [int(one) for one in listed]
    size = int(number) if number.isdecimal() else known[0]
    return f"{name}:{min(known, key=lambda one: abs(one - size))}"


def _replace_word(words: Sequence[str], old: str, new: str) -> list[str] | None:
    """Return the words with another word, or another value after ``--option=``; None where it is not there."""
    changed = []
    for word in words:
        option, equals, value = word.partition("=")
        joined = word.startswith("--") and equals and value == old
        changed.append(f"{option}={new}" if joined else new if word == old else word)
    return changed if changed != list(words) else None


def _find_option(name: str, command: click.Command, words: Sequence[str]) -> str | None:
    """Return the option that takes the value, is spelt alike, or begins with the one letter that was typed, or None."""
    parameters = [parameter for parameter in command.params if isinstance(parameter, click.Option)]
    value = " ".join(words).partition(f" {name}")[2].lstrip(" =").split(" ")[0]
    for parameter in parameters:
        if isinstance(parameter.type, click.Choice) and value in parameter.type.choices:
            return max(parameter.opts, key=len)
    options = [option for parameter in parameters for option in parameter.opts]
    if not name.startswith("--"):
        completions = [option for option in options if option.startswith(f"-{name}")]
        return completions[0] if len(completions) == 1 else None
    near = difflib.get_close_matches(name, options, n=1, cutoff=_LIKE_OPTION)
    return near[0] if near else None


def _replace_option(word: str, name: str, meant: str | None) -> str:
    """Return a word, which may be joined to its value, with the option that is meant."""
    option, equals, value = word.partition("=")
    return f"{meant}{equals}{value}" if option == name else word


def _guess_config(rejected: str) -> str:
    """Return the config of the results in which a rejected file is; empty if there is none."""
    path = Path(rejected)
    if path.suffix not in (".h5", ".json", ".html"):
        return ""
    config = guess_config(str(path.parent))
    return "" if config is None else shlex.quote(str(config))


def _keep_config_arguments(words: Sequence[str]) -> str:
    """Return the config of a command line, and the options that change it or say where its results are."""
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
