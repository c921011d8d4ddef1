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

from paramreduce_cli.lean.model import LeanModels
from paramreduce_cli.resources.processes import Item, WorkerPool, start_workers
from paramreduce_cli.terms.descent import Descent, Way, gone_on
from paramreduce_cli.terms.fitting import Budget, Fitting
from paramreduce_cli.terms.samples import TermSamples
from paramreduce_cli.terms.search import NOISE, TermSearch
from paramreduce_cli.terms.starts import Start, near
from paramreduce_cli.terms.tape import Tape

_NOISY = 0.5
"""How often there is noise in the choice of terms, but from the first starts."""


@dataclass(frozen=True)
class LookedAt:
    """Samples that are looked at while terms are left out."""

    samples: TermSamples
    """What parameters are fitted to."""
    watched: TermSamples | None
    """On which errors must be within the budget as well."""


class Near(NamedTuple):
    """A start near which is another one to go down from."""

    start: Start
    others: list[Start]
    """What it may have some of."""
    turn: int
    """Number of the dice."""


class Again(NamedTuple):
    """A descent to go down once more from shortly before its end."""

    way: Way
    """What it has come by."""
    turn: int
    """Number of the dice."""


@dataclass(frozen=True)
class Searcher:
    """Goes down from starts."""

    lean: LeanModels
    """Programs of reduced models."""
    looked_at: LookedAt
    """Samples for most of the search."""
    closely: LookedAt
    """More samples, for the best of what was found."""
    poses: TermSamples | None
    """States at which mass matrices must be positive definite."""
    budget: Budget
    direct: bool
    """Whether [M | delta] is meant, not torques."""
    seed: int = 0
    """Of what is random."""

    def begun(self, start: Start, turn: int = 0) -> Descent:
        """With all terms."""
        program = start.program(self.lean, direct=self.direct)
        return Descent.begun(start, program, self._searching(start, self.looked_at, turn))

    def down(self, start: Start) -> Way:
        """From a start until no more terms can go."""
        return self.begun(start).down()

    def nearby(self, what: Near) -> Way | None:
        """The same from one near another one, half the times with noise; None where it is not within the budget.

        The function is the same to begin with, but at the edge of the budget rounding may tell.
        """
        rng = np.random.default_rng([self.seed, what.turn])
        start = near(what.start, what.others, self.lean, rng, direct=self.direct)
        return _down(self.begun(start, what.turn), rng)

    def again(self, what: Again) -> Way | None:
        """The same from a program shortly before the end of a descent, written in another way."""
        rng = np.random.default_rng([self.seed, what.turn, 2])
        searching = self._searching(what.way.start, self.looked_at, what.turn)
        return _down(Descent.again(what.way, rng, searching), rng)

    def closer(self, way: Way) -> Way | None:
        """On from what a descent has come by with more samples."""
        return gone_on(way, self._searching(way.start, self.closely))

    def _searching(
        self, start: Start, some: LookedAt, turn: int = 0
    ) -> Callable[[Tape], TermSearch]:
        def made(tape: Tape) -> TermSearch:
            fitting = Fitting(
                tape, start.model.n, some.samples, self.budget, some.watched, self.poses
            )
            return TermSearch(fitting, self.seed + turn)

        return made


def _down(descent: Descent, rng: np.random.Generator) -> Way | None:
    """Until no more terms can go, half the times with noise; None where it does not begin within the budget."""
    noise = NOISE * (rng.random() < _NOISY)
    return descent.down(noise) if descent.end.fit.within else None


class Hands:
    """What does the work of a searcher, here or in other processes.

    Args:
        told: Of what is found on an item, as soon as it is.
        deadline: After which nothing is begun, on the clock of `time.monotonic`, which processes share, s.
        pool: Workers that hold the searcher.
    """

    def __init__(
        self, told: Callable[[Way | None], None], deadline: float, pool: WorkerPool[Searcher]
    ) -> None:
        self._told, self._deadline, self._pool = told, deadline, pool
        self.cut_short = False
        """Whether anything was not begun for the deadline."""

    def in_time(self) -> bool:
        """Whether there is time for what is asked for; if not, the search is cut short."""
        self.cut_short |= time.monotonic() > self._deadline
        return not self.cut_short

    def each(
        self,
        work: Callable[[Searcher, Item], Way | None],
        items: Iterable[Item],
        *,
        however_late: bool = False,
    ) -> list[Way]:
        """What is found on items, in their order; on one of them at least, and no others when it is too late."""
        in_time = partial(_begun, work, math.inf if however_late else self._deadline)
        found: dict[int, Way] = {}
        for (number, _), (begun, way) in self._pool.map_unordered(in_time, enumerate(items)):
            self.cut_short |= not begun
            self._told(way)
            if way is not None:
                found[number] = way
        return [found[number] for number in sorted(found)]


def _begun(
    work: Callable[[Searcher, Item], Way | None],
    deadline: float,
    searcher: Searcher,
    numbered: tuple[int, Item],
) -> tuple[bool, Way | None]:
    """Whether an item was begun before the deadline, as the first one always is, and what was found on it."""
    number, item = numbered
    if number and time.monotonic() > deadline:
        return False, None
    return True, work(searcher, item)


@contextlib.contextmanager
def hands(
    searcher: Searcher, jobs: int, told: Callable[[Way | None], None], deadline: float = math.inf
) -> Iterator[Hands]:
    """Work here, or in so many other processes; what is found by no deadline does not depend on how many."""
    with start_workers(jobs, partial(_same, searcher)) as pool:
        yield Hands(told, deadline, pool)


def _same(searcher: Searcher) -> Searcher:
    return searcher
