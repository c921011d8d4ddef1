"""Mappings by name whose errors list the names."""

from typing import TypeVar

Value = TypeVar("Value")


class Choices(dict[str, Value]):
    """A mapping whose KeyError lists all keys."""

    def __missing__(self, key: str) -> Value:
        raise KeyError(f"unknown name {key!r}. Choose from: {', '.join(self) or 'none'}")
