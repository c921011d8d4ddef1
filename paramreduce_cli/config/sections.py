"""Sections of a config by their types, so that a stage's signature can name them.

A section is a part of the schema with a type of its own: ``validation`` is the
``ValidationSection``, ``validation.operations`` the ``CountedDynamics``; ``Robot`` is all that
stands at the top level itself.
"""

import hashlib
import json
import types
import typing
from collections.abc import Iterator
from functools import cache
from typing import Any

from pydantic import BaseModel

from paramreduce_cli.config.schema import Config, Settings
from paramreduce_cli.errors import Key
from paramreduce_cli.robots import Robot


@cache
def _list_keys() -> dict[type, Key]:
    return dict(_walk(Config, ()))


def _walk(model: type[BaseModel], path: Key) -> Iterator[tuple[type, Key]]:
    for name, field in model.model_fields.items():
        kind = field.annotation
        if isinstance(kind, types.UnionType):  # a section that may be left out
            kind = next(iter(typing.get_args(kind)))
        if isinstance(kind, type) and kind.__module__.startswith("paramreduce_cli."):
            yield kind, (*path, name)
            if issubclass(kind, BaseModel):
                yield from _walk(kind, (*path, name))


def find_keys(name: str) -> list[str]:
    """Return the keys ``SECTION.NAME`` of all top-level sections that have a key of this name."""
    return [
        f"{path[0]}.{name}"
        for kind, path in _list_keys().items()
        if len(path) == 1 and issubclass(kind, BaseModel) and name in kind.model_fields
    ]


def is_section(kind: type) -> bool:
    """Return whether a type is a section of a config."""
    return kind is Robot or kind in _list_keys()


def has_default(kind: type) -> bool:
    """Return whether a section may be left out, so that no config is needed for it."""
    return kind is not Robot and not Config.model_fields[str(_list_keys()[kind][0])].is_required()


def get_section(config: Config | Settings | None, kind: type) -> Any:
    """Return a section of a config or of settings, or its default if these are None or lack the section.

    The default of an optional section is None; ``Robot`` is the config itself.
    """
    if kind is Robot:
        return config
    path = _list_keys()[kind]
    value: Any = config
    if not hasattr(config, str(path[0])):
        value, path = Config.model_fields[str(path[0])].default, path[1:]
    for name in path:
        value = getattr(value, str(name))
    return value


def digest_sections(config: Config, kind: type) -> dict[str, str]:
    """Return the digests of a section by key; ``Robot`` has one for each of its keys.

    Constants do not count, as their values are in the keys that use them.
    """
    robot = [(name,) for name in Robot.model_fields if name != "constants"]
    keys = robot if kind is Robot else [_list_keys()[kind]]
    return {".".join(map(str, key)): digest_section(config, key) for key in keys}


def digest_section(config: Config, key: Key) -> str:
    """Return the digest of a part of a config, which shows whether the part has changed; empty if there is no such
    part.
    """
    value: Any = config.model_dump(mode="json")
    for name in key:
        if not isinstance(value, dict) or name not in value:
            return ""
        value = value[name]
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()
