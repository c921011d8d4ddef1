"""Descents of one function's programs, in this process or in several."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from paramreduce_cli.lean.lean_models import LeanModels
from paramreduce_cli.resources.processes import Item, WorkerPool, start_workers
from paramreduce_cli.terms.descent import Descent, SearchHistory, continue_on_samples
from paramreduce_cli.terms.fit_samples import TermSamples
from paramreduce_cli.terms.program_fitting import Budget, Fitting
from paramreduce_cli.terms.starts import Start, vary_start
from paramreduce_cli.terms.tape import Tape
from paramreduce_cli.terms.term_removal import NOISE, TermSearch

_NOISY = 0.5
"""How often there is noise in the choice of terms, but from the first starts."""


@dataclass(frozen=True)
class SearchSamples:
    """A pair of samples for a search: those that parameters are fitted to, and those that errors are watched on."""

    samples: TermSamples
    """Samples that parameters are fitted to."""
    watched: TermSamples | None
    """Samples whose errors must also be within the budget."""


class NearbyStart(NamedTuple):
    """A start to vary before descending from it."""

    start: Start
    others: list[Start]
    """Starts that parts may be copied from."""
    seed_index: int
    """Index of the random seed."""


class Restart(NamedTuple):
    """A finished descent to repeat from shortly before its end."""

    history: SearchHistory
    """History of the descent."""
    seed_index: int
    """Index of the random seed."""


@dataclass(frozen=True)
class Searcher:
    """A searcher that descends from starts."""

    lean: LeanModels
    """Programs of reduced models."""
    search_samples: SearchSamples
    """Samples for most of the search."""
    closely: SearchSamples
    """More samples, for the best of what was found."""
    poses: TermSamples | None
    """States at which mass matrices must be positive definite."""
    budget: Budget
    direct: bool
    """Whether [M | delta] is meant, not torques."""
    seed: int = 0
    """Seed of the random choices."""

    def start_descent(self, start: Start, turn: int = 0) -> Descent:
        """Return a descent with all terms of a start."""
        program = start.build_program(self.lean, direct=self.direct)
        return Descent.start_from(
            start, program, self._make_search(start, self.search_samples, turn)
        )

    def descend(self, start: Start) -> SearchHistory:
        """Descend from a start until no more terms can go."""
        return self.start_descent(start).descend()

    def descend_nearby(self, what: NearbyStart) -> SearchHistory | None:
        """Descend from a start near another one, with noise half of the time; return None if that start exceeds the
        budget.
        """
        rng = np.random.default_rng([self.seed, what.seed_index])
        start = vary_start(what.start, what.others, self.lean, rng, direct=self.direct)
        return _descend(self.start_descent(start, what.seed_index), rng)

    def repeat_descent(self, what: Restart) -> SearchHistory | None:
        """Descend from a program shortly before the end of a descent, written in another way; return None if that
        program exceeds the budget.
        """
        rng = np.random.default_rng([self.seed, what.seed_index, 2])
        searching = self._make_search(what.history.start, self.search_samples, what.seed_index)
        return _descend(Descent.restart(what.history, rng, searching), rng)

    def descend_closely(self, history: SearchHistory) -> SearchHistory | None:
        """Continue a descent with more samples; return None if no program on the way is within the budget there."""
        return continue_on_samples(history, self._make_search(history.start, self.closely))

    def _make_search(
        self, start: Start, some: SearchSamples, turn: int = 0
    ) -> Callable[[Tape], TermSearch]:
        """Return a function that makes the term search of a program on some samples."""

        def make(tape: Tape) -> TermSearch:
            """Return the term search of a program."""
            fitting = Fitting(
                tape, start.model.n, some.samples, self.budget, some.watched, self.poses
            )
            return TermSearch(fitting, self.seed + turn)

        return make


def _descend(descent: Descent, rng: np.random.Generator) -> SearchHistory | None:
    """Descend until no more terms can go, with noise half of the time; return None if the start is not within the
    budget.
    """
    noise = NOISE * (rng.random() < _NOISY)
    return descent.descend(noise) if descent.end.fit.within else None


class WorkerGroup:
    """The workers of a searcher, in this process or in others.

    Args:
        on_descent: Called with the result of each item.
        deadline: Time after which nothing begins, on the clock of `time.monotonic`, which processes share, s.
        pool: Workers that hold the searcher.
    """

    def __init__(
        self,
        on_descent: Callable[[SearchHistory | None], None],
        deadline: float,
        pool: WorkerPool[Searcher],
    ) -> None:
        self._told, self._deadline, self._pool = on_descent, deadline, pool
        self.cut_short = False
        """Whether anything was not begun for the deadline."""

    def is_in_time(self) -> bool:
        """Return whether time is left; if not, the search is marked as cut short."""
        self.cut_short |= time.monotonic() > self._deadline
        return not self.cut_short

    def map(
        self,
        work: Callable[[Searcher, Item], SearchHistory | None],
        items: Iterable[Item],
        *,
        however_late: bool = False,
    ) -> list[SearchHistory]:
        """Return the results of items in their order: of the first item at least, and of others that start before the
        deadline.
        """
        in_time = partial(_work_in_time, work, math.inf if however_late else self._deadline)
        found: dict[int, SearchHistory] = {}
        for (number, _), (started, history) in self._pool.map_unordered(in_time, enumerate(items)):
            self.cut_short |= not started
            self._told(history)
            if history is not None:
                found[number] = history
        return [found[number] for number in sorted(found)]


def _work_in_time(
    work: Callable[[Searcher, Item], SearchHistory | None],
    deadline: float,
    searcher: Searcher,
    numbered: tuple[int, Item],
) -> tuple[bool, SearchHistory | None]:
    """Return whether an item was started before the deadline, as the first one always is, and its result; None if not."""
    number, item = numbered
    if number and time.monotonic() > deadline:
        return False, None
    return True, work(searcher, item)


@contextlib.contextmanager
def start_searchers(
    searcher: Searcher,
    jobs: int,
    on_descent: Callable[[SearchHistory | None], None],
    deadline: float = math.inf,
) -> Iterator[WorkerGroup]:
    """Start processes for a searcher, or none for one job; without a deadline results do not depend on their number."""
    with start_workers(jobs, partial(_same, searcher)) as pool:
        yield WorkerGroup(on_descent, deadline, pool)


def _same(searcher: Searcher) -> Searcher:
    return searcher
