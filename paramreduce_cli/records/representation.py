"""Short texts of records: a line to ten, with the shapes of arrays in place of their values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from typing import Any, TypeVar, dataclass_transform

import numpy as np

Record = TypeVar("Record")

_WIDTH = 88
"""Characters of a text that stays on one line."""
_MOST_FIELDS = 8
_MOST_CHARACTERS = 60
"""Characters of a value."""


@dataclass_transform(frozen_default=True)
def record(cls: type[Record]) -> type[Record]:
    """Make a class a frozen dataclass whose ``repr`` has at most ten lines."""
    cls.__repr__ = format_record  # type: ignore[method-assign]
    return dataclass(frozen=True, repr=False)(cls)


def format_record(instance: Any) -> str:
    """Return a record as text of ten lines at most."""
    texts = [
        f"{field.name}={_format_value(getattr(instance, field.name))}" for field in fields(instance)
    ]
    name = type(instance).__name__
    line = f"{name}({', '.join(texts)})"
    if len(line) <= _WIDTH:
        return line
    shown, rest = texts[:_MOST_FIELDS], texts[_MOST_FIELDS:]
    more = (
        [f"... and {', '.join(text.partition('=')[0] for text in rest)}"[:_WIDTH]] if rest else []
    )
    return "\n  ".join([f"{name}(", *shown, *more]) + ")"


def _format_value(value: Any) -> str:
    """Return a field's value on one line: sizes of what is large, names of what is nested."""
    if isinstance(value, np.ndarray):
        return f"{value.dtype} array {value.shape}"
    if isinstance(value, Enum):
        return str(value)
    if is_dataclass(value):
        return type(value).__name__
    if isinstance(value, Mapping):
        return _shorten(f"{len(value)} by name: {', '.join(map(str, value))}")
    if isinstance(value, Sequence) and not isinstance(value, str):
        short = repr(value) if all(isinstance(item, str | float | int) for item in value) else ""
        kind = f" {type(value[0]).__name__}" if len(value) else ""
        return (
            short
            if 0 < len(short) <= _MOST_CHARACTERS
            else f"{type(value).__name__} of {len(value)}{kind}"
        )
    return type(value).__name__ if repr(value).startswith("<") else _shorten(repr(value))


def _shorten(text: str) -> str:
    """Return the text cut to the characters that a value may have."""
    text = " ".join(text.split())
    return text if len(text) <= _MOST_CHARACTERS else f"{text[: _MOST_CHARACTERS - 3]}..."
