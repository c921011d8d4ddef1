"""The task of a heuristic, and the subsets that it returns."""

from __future__ import annotations

from collections.abc import Callable, Iterable, MutableMapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from paramreduce_cli.records import WHOLE, IntArray, Part, Progress, Proofs
from paramreduce_cli.reduction.heuristics import heuristics
from paramreduce_cli.reduction.objective import Objective, Subset


@dataclass(frozen=True)
class Effort:
    """The effort of a search: numbers of kicks and nodes, time, and threads."""

    kicks: int = 8
    """Random changes of a subset from which the swap search starts again."""
    seed: int = 0
    """Seed of these changes."""
    time_limit: float = 60.0
    """Time limit of proofs, s."""
    node_limit: int | None = None
    """Largest number of nodes in the proof of one size; unlike a time limit it gives the same result on every machine."""
    subtrees: bool = False
    """Whether jobs split the search for every proof, instead of taking some proofs each."""
    jobs: int = 1
    """Threads that search for proofs."""


def _interrupt() -> None:
    raise KeyboardInterrupt


@dataclass(frozen=True)
class SelectionTask:
    """A criterion to select by, the largest size, and the effort."""

    objective: Objective
    largest: int | None = None
    """Number of columns at which to stop; all if None."""
    smallest: int = 1
    """Numbers of columns below this are not wanted, but may be passed through."""
    effort: Effort = Effort()
    previous: Proofs | None = None
    """Proofs of an earlier run on the same data."""
    part: Part = WHOLE
    """Part of the proofs that this job does."""
    incumbents: MutableMapping[str, Any] = field(default_factory=dict)
    """Best subsets that jobs of the same search exchange, by ``incumbent-SIZE``."""
    keep: Callable[[Proofs], None] = lambda _: None
    """Called with the proof of a size that took long, as soon as its search has ended."""
    progress: Callable[[Progress], None] = lambda _: None
    interrupted: Callable[[], None] = _interrupt
    """Told that a KeyboardInterrupt was met; raises it again where nothing is worth keeping."""
    known: dict[Any, FoundSubsets] = field(default_factory=dict)
    """Subsets found earlier on the same data, by heuristic and options."""

    @cached_property
    def limit(self) -> int:
        """Largest number of columns."""
        most = self.objective.largest
        return most if self.largest is None else min(most, self.largest)


@dataclass(frozen=True)
class FoundSubsets:
    """The subsets that a heuristic has found, by number of columns; each lists its columns in the order in which they
    were added.
    """

    subsets: tuple[IntArray, ...]
    proofs: Proofs | None = None


def run(heuristic: str, task: SelectionTask) -> FoundSubsets:
    """Run a heuristic by its name; the result of the same heuristic on the same problem is reused, because several
    heuristics start from others.
    """
    key = (heuristic, task.objective, task.limit, task.smallest, task.effort)
    if key not in task.known:
        task.known[key] = heuristics[heuristic](task)
    return task.known[key]


def make_nested(task: SelectionTask, order: Subset) -> FoundSubsets:
    """Return the nested subsets of growing size that an order of all groups gives."""
    columns = task.objective.list_columns(order)
    ends = np.cumsum(task.objective.widths[list(order)]).tolist()
    return FoundSubsets(tuple(columns[:end] for end in ends if end <= task.limit))


def append_others(objective: Objective, kept: Subset) -> Subset:
    """Return a subset with all other groups after it, in order of preference."""
    return (*kept, *(u for u in range(len(objective.groups)) if u not in kept))


def sort_by_size(objective: Objective, subsets: Iterable[Subset]) -> FoundSubsets:
    """Return subsets in order of their number of columns."""
    return FoundSubsets(tuple(sorted((objective.list_columns(kept) for kept in subsets), key=len)))
