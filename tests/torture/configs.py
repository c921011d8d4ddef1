"""Configs with parts taken out, doubled or exchanged: a config, or one clear message."""

import copy
import random
from collections import Counter

import yaml

from paramreduce_cli.config import load_config
from paramreduce_cli.errors import ParamreduceError
from tests.torture import CONFIG

_VALUES = (
    None, True, 0, -1, 1e308, 1e-308, float("nan"), float("inf"), 10**30, "", "x", "pi/0", "2*pi", [],
    [[]], {}, {"x": 1}, [1, 2, 3], "=", "!!bool x", "\x00", "a" * 1000, [None] * 100,
)  # fmt: skip
_TEXTS = (
    "",
    "\t",
    "- ",
    ": ",
    "&a ",
    "*a",
    "[",
    "}",
    "'",
    "\n",
    "#",
    "!!int ",
    "<<: ",
    "\u2028",
    "9e999",
)


def places(data, path=()):
    """All paths into a config."""
    yield path
    if isinstance(data, dict | list):
        for key in data if isinstance(data, dict) else range(len(data)):
            yield from places(data[key], (*path, key))


def changed(data, chance):
    """One value of a config exchanged, or left out."""
    *path, last = chance.choice([p for p in places(data) if p])
    for key in path:
        data = data[key]
    if chance.random() < 0.2:
        del data[last]
    else:
        data[last] = copy.deepcopy(chance.choice(_VALUES))


def try_configs(folder, count, seed=0):
    """Read configs that were tampered with.

    Returns:
        How often each thing happened.
    """
    chance = random.Random(seed)
    text, found = CONFIG.read_text(), Counter()
    path = folder / "config.yaml"
    for _ in range(count):
        if chance.random() < 0.5:
            data = yaml.safe_load(text)
            for _ in range(chance.randint(1, 3)):
                changed(data, chance)
            path.write_text(yaml.safe_dump(data, allow_unicode=True))
        else:
            place = chance.randrange(len(text))
            length = chance.choice((0, 0, 1, 5))
            path.write_text(text[:place] + chance.choice(_TEXTS) + text[place + length :])
        try:
            load_config(path)
            found["a config"] += 1
        except ParamreduceError as error:
            bounded = len(str(error)) < 20_000
            found["one message" if bounded else "a message without end"] += 1
        except Exception as error:
            found[f"not caught: {type(error).__name__}: {error}"[:100]] += 1
    return found
