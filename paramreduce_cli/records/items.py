"""Items of a stage: pieces of work that are computed once, kept, and combined in the end."""

from __future__ import annotations

from collections.abc import MutableMapping, Sequence
from dataclasses import field
from typing import Any, TypeVar

from paramreduce_cli.records.representation import record

T = TypeVar("T")


@record
class Part:
    """A part of a stage's items, written ``3/8``: every eighth item from the third on; by default all items."""

    number: int = 1
    """Number of the job, from 1 on."""
    count: int = 1
    """Number of jobs."""

    @classmethod
    def parse(cls, text: str) -> Part:
        """Read ``NUMBER/COUNT``.

        Raises:
            ValueError: The text is no such part.
        """
        number, slash, count = text.partition("/")
        if not (slash and number.isdecimal() and count.isdecimal()):
            raise ValueError(f"{text!r} is not of the form 3/8.")
        if not 1 <= int(number) <= int(count):
            raise ValueError(f"{text!r} is not one of {count} parts, which count from 1.")
        return cls(int(number), int(count))

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"

    @property
    def is_whole(self) -> bool:
        """Whether the part is all items."""
        return self.count == 1

    def select(self, items: Sequence[T]) -> list[T]:
        """Return the items of this part: neighbours, which are alike, go to different jobs."""
        return list(items[self.number - 1 :: self.count])


WHOLE = Part()
"""All items."""


@record
class Items:
    """The items of a stage."""

    kept: MutableMapping[str, Any] = field(default_factory=dict)
    """Finished items by key, which outlive an interrupted run."""
    part: Part = WHOLE
    """Items that this job does."""


class PartFinished(Exception):  # noqa: N818 - no error
    """Raised when a job has finished its part, so that nothing is combined."""
