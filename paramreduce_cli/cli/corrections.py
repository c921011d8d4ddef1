"""The call that was meant, read from what an error says of the one that was typed."""

import difflib
import re
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path

Words = list[str]


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
        return None
    whole, key, value, meant = found.groups()
    if wrong := re.search(r": key '(\S+)' is not known", message):
        key = ".".join(meant if name == wrong[1] else name for name in key.split("."))
    else:
        value = meant
    return _exchanged(words, whole, f"{key}={value}")


def _choice(message: str, words: Words) -> Words | None:
    """One of those that there are, the likest."""
    found = re.match(r"--\S+ (\S+): there is ([^;]+?)[;.]?(?: with .*)?$", message)
    if found is None:
        return None
    wanted, number = found[1], found[1].partition(":")[2]
    offered = [_in_range(name, number) for name in found[2].split(", ")]
    near = difflib.get_close_matches(wanted, offered, n=1, cutoff=0.0)
    return _exchanged(words, wanted, near[0])


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
