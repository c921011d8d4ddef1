"""Records as plain data, such as JSON can hold, and back."""

import dataclasses
import math
import types
import typing
from collections.abc import Mapping
from enum import Enum
from typing import Any

import numpy as np


def to_plain(value: Any) -> Any:
    """Return a record, or a part of it, as lists, mappings, texts and numbers: members of enums by name, numbers that
    are not finite as texts. Everything else stays as it is.
    """
    if dataclasses.is_dataclass(value):
        return {f.name: to_plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, np.ndarray):
        return to_plain(value.tolist())
    if isinstance(value, Mapping):
        return {key: to_plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [to_plain(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


def from_plain(hint: Any, data: Any) -> Any:
    """Return a record, or a part of it, from plain data; the inverse of :func:`to_plain`.

    Args:
        hint: Type of the record, or of a part of it.
        data: Plain data.

    Raises:
        KeyError, TypeError, ValueError: The data are not of that type.
    """
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if dataclasses.is_dataclass(hint):
        hints = typing.get_type_hints(hint)
        known = {f.name: from_plain(hints[f.name], data[f.name]) for f in dataclasses.fields(hint)}
        return typing.cast(Any, hint)(**known)
    if isinstance(hint, type) and issubclass(hint, Enum):
        return hint[data]
    if origin is np.ndarray:
        return np.array(data, dtype=get_dtype(hint))
    if origin in (typing.Union, types.UnionType):
        members = [a for a in arguments if a is not type(None)]
        return data if data is None or len(members) > 1 else from_plain(members[0], data)
    if origin is Mapping:
        return {key: from_plain(arguments[1], entry) for key, entry in data.items()}
    if origin is tuple:
        inner = arguments[:1] * len(data) if arguments[-1] is Ellipsis else arguments
        return tuple(from_plain(one, entry) for one, entry in zip(inner, data, strict=True))
    return float(data) if hint is float else data


def get_dtype(hint: Any) -> type:
    """Return the type of the numbers in an array, from the type hint of the array."""
    scalar: type = typing.get_args(typing.get_args(hint)[1])[0]
    return scalar
