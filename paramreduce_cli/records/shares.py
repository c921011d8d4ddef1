"""A stage's work as several jobs of about the same size, which any scheduler can run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

T = TypeVar("T")


@dataclass(frozen=True)
class Share:
    """One of several jobs, written ``3/8``; all of the work as it stands."""

    number: int = 1
    """From 1 on."""
    count: int = 1

    @classmethod
    def parse(cls, text: str) -> Share:
        """Read the text.

        Raises:
            ValueError: It is no share.
        """
        number, slash, count = text.partition("/")
        if not (slash and number.isdecimal() and count.isdecimal()):
            raise ValueError(f"{text!r} is not of the form 3/8.")
        if not 1 <= int(number) <= int(count):
            raise ValueError(f"{text!r} is none of {count} parts, which count from 1.")
        return cls(int(number), int(count))

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"

    @property
    def whole(self) -> bool:
        """Whether it is all of the work."""
        return self.count == 1

    def dealt(self, items: Sequence[T]) -> list[T]:
        """Every so many of some items: neighbours, which are alike, go to different jobs."""
        return list(items[self.number - 1 :: self.count])

    def cut(self, items: Sequence[T]) -> list[T]:
        """A run of consecutive items, those of all jobs as long as each other, but for one item."""
        n = len(items)
        return list(items[n * (self.number - 1) // self.count : n * self.number // self.count])


WHOLE = Share()
"""All of the work."""


@dataclass(frozen=True)
class Shares:
    """What the jobs of a stage have made, in their order, for the stage to put together; empty if all is yet to be done."""

    found: tuple[Any, ...] = ()


UNSHARED = Shares()
"""Where no other jobs were at work."""
