"""What to type next, for who has typed something that does not work."""

import difflib
import inspect
import re
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

import click

from paramreduce_cli.artifacts.places import SUMMARY
from paramreduce_cli.cli.corrections import corrected, misplaced
from paramreduce_cli.cli.here import config_meant, configs_in, has_report, results_in, results_of
from paramreduce_cli.stages import stages

_LEAST_LIKE = 0.6
_LIKE = 0.75
"""How alike options must be: all look alike a little, by their dashes."""


def meant_command(name: str, known: Sequence[str]) -> str:
    """What is said of a command that there is not."""
    wanted = name.lower().replace("_", "-")
    near = difflib.get_close_matches(wanted, known, n=1, cutoff=_LEAST_LIKE)
    if wanted == "version":
        return "there is no command 'version'; see `paramreduce --version`."
    hint = f"did you mean `paramreduce {near[0]}`?" if near else "`paramreduce --help` lists them."
    return (
        f"there is no command {name!r}; {'see `paramreduce --help`.' if wanted == 'help' else hint}"
    )


def next_command(command: click.Command | None) -> str:
    """An example of the command that was called wrongly; None stands for the program itself."""
    if command is None:
        return "paramreduce --help lists all commands; paramreduce alone says what to do next."
    example = re.search(r"Example: (paramreduce .*(?:\n.+)*)", inspect.cleandoc(command.help or ""))
    more = f"paramreduce {command.name} --help says more."
    shown = _of_here(" ".join(example[1].split())) if example else ""
    return f"Example: {shown}\n{more}" if shown else more


def _of_here(example: str) -> str:
    """An example with robots that are here; where there is none, with what brings its own.

    Empty where there are some, but too few for it.
    """
    typed = [Path(word) for word in sys.argv[1:] if word.endswith((".yaml", ".yml"))]
    own = [path for path in typed if path.is_file()]
    configs = list(dict.fromkeys([*own, *configs_in(Path())]))
    results = list(
        dict.fromkeys([*(r for r in map(results_of, own) if has_report(r)), *results_in(Path())])
    )
    named = re.findall(r"(?:configs|results)/[\w./-]+", example)
    first = ""
    here = {True: configs, False: results}
    unused = {kind: iter(found) for kind, found in here.items()}
    for path in (Path(name) for name in named if own or not Path(name).exists()):
        of_configs = path.suffix == ".yaml"
        other = next(unused[of_configs], None)
        if other is not None:
            example = example.replace(str(path), shlex.quote(str(other)))
        elif here[of_configs]:
            return ""
        elif configs:
            first = f"\nFirst: paramreduce run {shlex.quote(str(configs[0]))} makes results."
    if named and not configs and not results:
        first = f"\nFirst: paramreduce init {_example_of(named)} writes its config."
    return example + first


def _example_of(paths: Sequence[str]) -> str:
    """Options for the robot that paths in an example are of, if it comes along; else for one that does."""
    from paramreduce_cli.config.examples import examples  # late: it loads much

    known = examples()
    named = [Path(path).stem for path in paths if Path(path).stem in known]
    return f"--example {named[0]}" if named else "--example puma560"


def after(message: str, command: click.Command | None) -> str:
    """What to type next, where an error does not say it itself; empty where it does."""
    typed = sys.argv[1:]
    if mended := misplaced(message, typed):
        return f"Next: {mended}"
    if re.search(r"paramreduce [a-z]|`pip install ", message):
        return ""
    mended = corrected(message, typed)
    if not mended:
        return next_command(command)
    return f"{'Then again' if shlex.split(mended)[1:] == typed else 'Next'}: {mended}"


def of_usage(error: click.ClickException) -> str:
    """What is wrong with a call that cannot be read; click guesses options by their spelling alone."""
    if isinstance(error, click.NoSuchOption) and error.ctx and error.ctx.parent:
        return f"there is no option {error.option_name}."
    return error.format_message()


def after_usage(error: click.ClickException) -> str:
    """What to type after a call that cannot be read: the same with the option that was meant, or an example."""
    context = getattr(error, "ctx", None)
    command = context.command if context and context.parent else None
    if isinstance(error, click.NoSuchOption) and command is not None:
        meant = _meant_option(error.option_name, command)
        typed = sys.argv[1:]
        if meant:
            mended = [_with_option(word, error.option_name, meant) for word in typed]
            return f"Next: {shlex.join(['paramreduce', *mended])}"
    mended_call = misplaced(error.format_message(), sys.argv[1:])
    return f"Next: {mended_call}" if mended_call else next_command(command)


def _meant_option(name: str, command: click.Command) -> str | None:
    """The option that takes the value, is spelt alike, or begins with the one letter that was typed."""
    taken = [parameter for parameter in command.params if isinstance(parameter, click.Option)]
    value = " ".join(sys.argv[1:]).partition(f" {name}")[2].lstrip(" =").split(" ")[0]
    for parameter in taken:
        if isinstance(parameter.type, click.Choice) and value in parameter.type.choices:
            return parameter.opts[0]
    options = [option for parameter in taken for option in parameter.opts]
    if not name.startswith("--"):
        begun = [option for option in options if option.startswith(f"-{name}")]
        return begun[0] if len(begun) == 1 else None
    near = difflib.get_close_matches(name, options, n=1, cutoff=_LIKE)
    return near[0] if near else None


def _with_option(word: str, name: str, meant: str) -> str:
    """The option in a word, which may be joined to its value, by another one."""
    option, equals, value = word.partition("=")
    return f"{meant}{equals}{value}" if option == name else word


def with_arguments(text: str) -> str:
    """A message whose commands can be typed as they stand: with the config and options of this call.

    Without a config in the call that of the results in question is named, if it lies where it usually does.
    """
    given = _own_arguments(sys.argv[1:]) or _usual_config(text) or "CONFIG"

    def completed(found: re.Match[str]) -> str:
        name = found[1]
        return f"`paramreduce {name} {given}`" if name in stages or name == "run" else found[0]

    return re.sub(r"`paramreduce ([a-z-]+)`", completed, text)


def _usual_config(text: str) -> str:
    """Of the results folder whose file a message begins with; empty if there is none."""
    found = re.match(r"(\S+?)(?:/report)?/[\w-]+\.(?:h5|json|html): ", text)
    config = config_meant(found[1]) if found else None
    return "" if config is None else shlex.quote(str(config))


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
