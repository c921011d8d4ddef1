"""The sections of a config by their types, so that a stage's signature can name them.

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
def _keys() -> dict[type, Key]:
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


def keys_named(name: str) -> list[str]:
    """Keys of sections at the top that are called like that."""
    return [
        f"{path[0]}.{name}"
        for kind, path in _keys().items()
        if len(path) == 1 and issubclass(kind, BaseModel) and name in kind.model_fields
    ]


def is_section(kind: type) -> bool:
    """Whether a type is a section of a config."""
    return kind is Robot or kind in _keys()


def has_default(kind: type) -> bool:
    """Whether a section may be left out, so that no config is needed for it."""
    return kind is not Robot and not Config.model_fields[str(_keys()[kind][0])].is_required()


def section(config: Config | Settings | None, kind: type) -> Any:
    """A section of a config, or of settings; its default where there is none."""
    if kind is Robot:
        return config
    path = _keys()[kind]
    value: Any = config
    if not hasattr(config, str(path[0])):
        value, path = Config.model_fields[str(path[0])].default, path[1:]
    for name in path:
        value = getattr(value, str(name))
    return value


def digests(config: Config, kind: type) -> dict[str, str]:
    """Of a section, by its key; ``Robot`` is one for each key it has.

    Constants do not count: their values stand wherever they are used.
    """
    robot = [(name,) for name in Robot.model_fields if name != "constants"]
    keys = robot if kind is Robot else [_keys()[kind]]
    return {".".join(map(str, key)): section_digest(config, key) for key in keys}


def section_digest(config: Config, key: Key) -> str:
    """Of a part of a config, to tell whether it changed; empty if there is no such part."""
    value: Any = config.model_dump(mode="json")
    for name in key:
        if not isinstance(value, dict) or name not in value:
            return ""
        value = value[name]
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()
