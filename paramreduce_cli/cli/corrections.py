"""The call that was meant, read from what an error says of the one that was typed."""

import difflib
import re
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path

from paramreduce_cli.cli.here import config_meant, configs_in, project_above, results_meant
from paramreduce_cli.stages import stages

Words = list[str]
_OF_CONFIGS = ("run", "export", "export-trajectory")
"""Commands that take a config, beside the stages."""
_LIKE = 0.8
_OF_RESULTS = ("open", "inspect", "table")


def corrected(message: str, words: Sequence[str]) -> str:
    """A command to type instead; empty where the message does not tell what is meant.

    Args:
        message: Of the error.
        words: That were typed after ``paramreduce``.
    """
    for rule in _RULES:
        mended = rule(message, list(words))
        if mended is not None:
            return shlex.join(["paramreduce", *mended])
    return ""


def misplaced(message: str, words: Sequence[str]) -> str:
    """The same for who names a robot, but not what the command takes of it, or is in another folder."""
    if further_up := _from_above(message, list(words)):
        return further_up
    for rule in (_no_config, _other_kind, _example, _misspelt):
        mended = rule(message, list(words))
        if mended is not None and mended != list(words):
            return shlex.join(["paramreduce", *mended])
    return ""


def _no_config(message: str, words: Words) -> Words | None:
    """The first config here, where none is given."""
    if not re.search(r"Missing argument 'CONFIG'|Give a CONFIG|without a config, say", message):
        return None
    if any(word.startswith("--samples") for word in words):
        return None
    here = configs_in(Path())
    return [words[0], str(here[0]), *words[1:]] if here else None


def _other_kind(_: str, words: Words) -> Words | None:
    """A robot's config where its results are given, or the other way round, or its name alone."""
    if len(words) == 1 and (config := config_meant(words[0])) is not None:
        return ["run", str(config)]
    for place, word in enumerate(words[1:], 1):
        if word.startswith("-") or words[place - 1].startswith("--"):
            continue
        config, results = config_meant(word), results_meant(word)
        if words[0] in (*stages, *_OF_CONFIGS) and config is not None:
            return [*words[:place], str(config), *words[place + 1 :]]
        if words[0] in _OF_RESULTS and results is not None and Path(word).suffix != ".h5":
            return [*words[:place], str(results), *words[place + 1 :]]
        if words[0] in _OF_RESULTS and config is not None:
            return ["run", str(config)]
    return None


def _example(message: str, words: Words) -> Words | None:
    """A robot that comes along, and is not here yet."""
    from paramreduce_cli.config.examples import examples  # late: it loads much

    known = examples()
    asked = [word for word in words[1:] if not word.startswith("-")]
    if not asked:
        return None
    if words[0] == "init":
        return ["init", "--example", *asked] if words[1:] == asked and asked[0] in known else None
    if words[0] not in (*stages, *_OF_CONFIGS, *_OF_RESULTS):
        return None
    name = Path(asked[0]).name.removesuffix(".yaml")
    if name not in known or not re.search("no such file|is not there", message):
        return None
    return ["init", "--example", name]


def _misspelt(message: str, words: Words) -> Words | None:
    """A robot's name that is nearly that of one here."""
    named = re.match(r"([\w-]+): there is no such file", message)
    if named is None or words[0] not in (*stages, *_OF_CONFIGS):
        return None
    here = {path.stem: path for path in configs_in(Path())}
    near = difflib.get_close_matches(named[1], here, n=1, cutoff=_LIKE)
    return _exchanged(words, named[1], str(here[near[0]])) if near else None


def _from_above(message: str, words: Words) -> str:
    """The same call in the folder further up where the config is."""
    above = project_above(Path())
    named = re.match(r"(\S+): there is no such file", message)
    if above is None or named is None or not (above / named[1]).exists():
        return ""
    return f"cd {above} && {shlex.join(['paramreduce', *words])}"


def _file(message: str, words: Words) -> Words | None:
    found = re.match(r"(\S+): .*Did you mean ([^`\s]+)\?", message)
    return None if found is None else _exchanged(words, found[1], found[2])


def _results(message: str, words: Words) -> Words | None:
    """Results that are not there yet, of a config that is."""
    found = re.match(
        r"results/([\w.-]+?)(?:/\S*)?: (?:there is no such file|is not there)", message
    )
    config = Path("configs") / f"{found[1]}.yaml" if found else None
    return ["run", str(config)] if config is not None and config.is_file() else None


def _setting(message: str, words: Words) -> Words | None:
    found = re.match(r"--set (([^=\s]+)=(.*?)): .*did you mean (\S+)\?", message)
    if found is None:
        return _deeper(message, words)
    whole, key, value, meant = found.groups()
    if wrong := re.search(r": key '(\S+)' is not known", message):
        key = ".".join(meant if name == wrong[1] else name for name in key.split("."))
    else:
        value = meant
    return _exchanged(words, whole, f"{key}={value}")


def _deeper(message: str, words: Words) -> Words | None:
    """A key of the one section that has it, where its name alone is given."""
    found = re.match(r"--set ((\w+)=.*?): \2: key '\2' is not known", message)
    if found is None:
        return None
    from paramreduce_cli.config.sections import keys_named  # late: it loads much

    places = keys_named(found[2])
    value = found[1].partition("=")[2]
    return _exchanged(words, found[1], f"{places[0]}={value}") if len(places) == 1 else None


def _choice(message: str, words: Words) -> Words | None:
    """One of those that there are, the likest."""
    found = re.match(r"--\S+ (\S+): there is ([^;]+?)(?:;.*|\.)?$", message)
    if found is None:
        return None
    wanted, (name, _, number) = found[1], found[1].partition(":")
    selected = re.search(r"; (\S+):(\d+) is selected", message)
    if selected and name.isdecimal():
        name, number = selected[1], name
    offered = found[2].split("; ")[0].split(", ")
    begun = [one for one in offered if one.split(":")[0].startswith(name)]
    near = begun or difflib.get_close_matches(name, offered, n=1, cutoff=0.0)
    return _exchanged(words, wanted, _in_range(near[0], number or (selected or ("", "", ""))[2]))


def _in_range(name: str, number: str) -> str:
    """``swap:1...7`` with a number that it has."""
    found = re.fullmatch(r"(.*):(\d+)\.\.\.(\d+)", name)
    if found is None:
        return name
    model, low, high = found[1], int(found[2]), int(found[3])
    wanted = int(number) if number.isdecimal() else low
    return f"{model}:{min(max(wanted, low), high)}"


def _option(message: str, words: Words) -> Words | None:
    found = re.search(r"such as (--\S+ [^\s.]+)\.$", message) or re.search(r"give (--[a-z]+) ", message)  # fmt: skip
    return None if found is None else [*words, *found[1].split(" ")]


def _after_mending(message: str, words: Words) -> Words | None:
    """The same again, once the file is mended."""
    return words if re.match(r"\S+\.ya?ml, line \d+: ", message) else None


_RULES: tuple[Callable[[str, Words], Words | None], ...] = (
    _results,
    _file,
    _setting,
    _choice,
    _option,
    _after_mending,
)


def _exchanged(words: Words, one: str, other: str) -> Words | None:
    if one not in words:
        return None
    return [other if word == one else word for word in words]
