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
_OF_RESULTS = ("open", "inspect", "table")
"""Commands that take results."""
_LIKE = 0.8
"""How alike a robot's name must be to one here."""
_LEAST_LIKE = 0.5
"""The same to one that comes along."""


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


_NOT_THAT = re.compile(
    r"(?:Invalid value for '\w+': (?:File|Path) '(?P<folder>.+)' is a directory"
    r"|there is no command '(?P<command>.+?)'"
    r"|(?P<file>.+?)(?:/report)?: (?:there is no such file|is not there|is not a readable HDF5|cannot be read as text"
    r"|holds no results itself))"
)
"""Messages on a word that names what is not there, or not of the kind that the command takes."""


def _named(message: str, words: Words) -> str | None:
    """The typed word that an error complains of, if nothing is known to be meant by it."""
    found = _NOT_THAT.match(message)
    if found is None or "Did you mean" in message:
        return None
    word = found["folder"] or found["command"] or found["file"]
    return next((w for w in words if w == word or w.rstrip("/") == word), None)


def _other_kind(message: str, words: Words) -> Words | None:
    """A robot's config where its results are given, or the other way round, or its name alone."""
    word = _named(message, words)
    if word is None:
        return None
    config, results = config_meant(word), results_meant(word)
    if word == words[0]:
        return None if config is None or len(words) > 1 else ["run", str(config)]
    if words[0] in (*stages, *_OF_CONFIGS):
        return None if config is None else _exchanged(words, word, str(config))
    if words[0] not in _OF_RESULTS:
        return None
    if results is not None and results.resolve() != Path(word).resolve():
        return _exchanged(words, word, str(results))
    return None if config is None else ["run", str(config)]


def _example(message: str, words: Words) -> Words | None:
    """A robot that comes along, and is not here yet."""
    asked = [word for word in words[1:] if not word.startswith("-")]
    plain_init = words[0] == "init" and asked == words[1:2] == words[1:]
    word = asked[0] if plain_init else _named(message, words)
    if word is None or (not plain_init and config_meant(word) is not None):
        return None
    from paramreduce_cli.config.examples import examples  # late: it loads much

    name = Path(word).name.removesuffix(".yaml")
    return ["init", "--example", name] if name in examples() else None


def _misspelt(message: str, words: Words) -> Words | None:
    """A robot's name that is nearly that of one here."""
    named = re.match(r"([\w-]+): there is no such file", message)
    if named is None or words[0] not in (*stages, *_OF_CONFIGS):
        return None
    here = {path.stem: path for path in configs_in(Path())}
    near = difflib.get_close_matches(named[1], here, n=1, cutoff=_LIKE)
    return _exchanged(words, named[1], str(here[near[0]])) if near else None


def _from_above(message: str, words: Words) -> str:
    """The same call in the folder further up where that is."""
    above = project_above(Path())
    word = _named(message.partition(" configs holds ")[0], words)
    if above is None or word is None or Path(word).exists() or not (above / word).exists():
        return ""
    return f"cd {above} && {shlex.join(['paramreduce', *words])}"


def _file(message: str, words: Words) -> Words | None:
    found = re.match(r"(\S+): .*Did you mean ([^`\s]+)\?", message)
    return None if found is None else _exchanged(words, found[1], found[2])


def _results(message: str, words: Words) -> Words | None:
    """Results that are not there yet, of a config that is."""
    found = re.match(r"(results/\S+): (?:there is no such file|is not there)", message)
    config = config_meant(found[1]) if found else None
    return None if config is None else ["run", str(config)]


def _setting(message: str, words: Words) -> Words | None:
    found = re.match(r"--set (([^=\s]+)=(.*?)): .*did you mean (\S+)\?", message)
    if found is None:
        return _deeper(message, words)
    whole, key, value, meant = found.groups()
    if wrong := re.search(r": key '(\S+)' is not known", message):
        key = ".".join(meant if name == wrong[1] else name for name in key.split("."))
    elif item := re.search(r"'([^']+)' is not known", message):
        # All of the value, or one of a list.
        whole_item = rf"(?<![^\[\s,]){re.escape(item[1])}(?![^\]\s,])"
        value = re.sub(whole_item, lambda _: meant, value)
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
    offered = found[2].split(", ")
    if digits := re.fullmatch(r":?(\d+)\w*", wanted):
        numbered = [one.partition(":")[0] for one in offered if ":" in one]
        name, number = selected[1] if selected else numbered[0], digits[1]
    begun = [one for one in offered if one.split(":")[0].startswith(name)]
    # Any model is nearer to what is wanted than none; any robot is not.
    least = _LEAST_LIKE if message.startswith("--example") else 0.0
    near = begun or difflib.get_close_matches(name, offered, n=1, cutoff=least)
    if not near:
        return None
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
    if "are, such as --results" in message and not any(w.startswith("--samples") for w in words):
        return None  # results alone do not help where there are none
    found = re.search(r"such as (--\S+ [^\s.]+)\.$", message) or re.search(r"give (--[a-z]+) ", message)  # fmt: skip
    return None if found is None else [*words, *found[1].split(" ")]


def _elsewhere(message: str, words: Words) -> Words | None:
    """Another file, where one stands already."""
    found = re.match(r"(\S+): exists already", message)
    if found is None:
        return None
    taken = Path(found[1])
    free = next(
        path for k in range(2, 1000) if not (path := taken.with_stem(f"{taken.stem}_{k}")).exists()
    )
    return _exchanged(words, found[1], str(free)) or [*words, "--output", str(free)]


def _after_mending(message: str, words: Words) -> Words | None:
    """The same again, once the file is mended."""
    return words if re.match(r"\S+\.ya?ml, line \d+: ", message) else None


_RULES: tuple[Callable[[str, Words], Words | None], ...] = (
    _results,
    _file,
    _setting,
    _choice,
    _option,
    _elsewhere,
    _after_mending,
)


def _exchanged(words: Words, one: str, other: str) -> Words | None:
    """With another word, or another value after ``--option=``."""
    joined = [f"{word.partition('=')[0]}={other}" if word.startswith("--") and word.partition("=")[2] == one else word for word in words]  # fmt: skip
    mended = [other if word == one else word for word in joined]
    return mended if mended != words else None
