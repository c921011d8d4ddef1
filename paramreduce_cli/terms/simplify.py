"""The leanest program of one function within a budget of errors, found by leaving terms out."""

from __future__ import annotations

import heapq
import math
import time
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from paramreduce_cli.terms.descent import Descent, Simplified, Way, drawn, front, leanest, slimmed
from paramreduce_cli.terms.searching import Again, Hands, Near, Searcher, hands
from paramreduce_cli.terms.starts import Start, promising

_LOOKED_AT = 200
"""Starts that are looked at to find the smallest one within the budget, at most."""
_WORK = 40_000
"""Operations times torques, of all programs that are gone down from first: time grows a little faster."""
_FEWEST, _MOST = 12, 30
"""How many these are at the least, and at most."""
_WORK_NEARBY = 400_000
"""The same of those near the best ones, unless it is said how many they are."""
_FEWEST_NEARBY, _MOST_NEARBY = 8, 40
"""How many these are at the least, and at most."""
_BEST = 4
"""Starts with the leanest ends, near which others are gone down from."""
_DRAWN = 0.25
"""How often this is done near one of all, so that what is no better at once is gone on from too."""
_AT_ONCE = 8
"""Of these others, before the best are looked for again."""
_CLOSELY = 8
"""Leanest ends of all descents, gone on from with more samples."""
_MANY = 20_000
"""Operations times torques, of all programs that are gone down from, from which on the start of processes pays."""
_LEANEST = 12
"""Programs that are judged, the leanest of all searches."""


class Found(NamedTuple):
    """What a search has come to: no programs where no start is within the budget."""

    ends: list[Simplified]
    """Programs, the leanest first."""
    front: list[Simplified]
    """Programs on the way to them, by operations."""
    cut_short: bool = False
    """Whether its time was over before it was."""


def simplified(
    searcher: Searcher,
    starts: list[Start],
    *,
    rounds: int | None,
    seconds: float = math.inf,
    jobs: int = 1,
    progress: Callable[[float, str], None] = lambda *_: None,
) -> Found:
    """Leave terms out, and let nodes stand for others, as long as errors stay within a budget.

    Starts are gone down from, each in the formulation that is leanest for it, then others near the best ones, whose
    formulations are changed at random; then once more from programs shortly before the best ends, written in other
    ways, as long as that helps; from the best ends it goes on with more samples.

    Args:
        searcher: Goes down from them.
        starts: Subsets, the smallest first; how many are gone down from depends on their operations.
        rounds: How many starts near the best ones are gone down from, and how many descents once more may bring
            nothing until these end; None for as many as their operations allow.
        seconds: After which no more descents are begun, but the last ones, with more samples; then what is found
            depends on the machine.
        jobs: Processes; what is found in time does not depend on them.
        progress: Told what share is done, and the fewest operations so far.

    Raises:
        DataError: A process died.
    """
    deadline = time.monotonic() + seconds
    every = map(searcher.begun, starts[:_LOOKED_AT])
    smallest = next((one.start for one in every if one.end.fit.within), None)
    if smallest is None:
        return Found([], [])
    begins = _first(searcher, promising(starts, smallest.model.n))
    work = _work(searcher, begins)
    if rounds is None:
        rounds = int(np.clip(_WORK_NEARBY / work, _FEWEST_NEARBY, _MOST_NEARBY))
    told = _Told(progress, len(begins) + 2 * rounds + _CLOSELY)

    def beside(ends: Sequence[Way], turn: int) -> Near:
        rng = np.random.default_rng([searcher.seed, turn, 1])
        best = leanest(ends, _BEST)
        parent = best[turn % len(best)] if rng.random() > _DRAWN else drawn(ends, rng)
        return Near(parent.start, [one.start for one in best], turn)

    pays = told.ahead * work > _MANY
    with hands(searcher, jobs if pays else 1, told, deadline) as working:
        ends = working.each(Searcher.down, [one.start for one in begins])
        for first in range(0, rounds, _AT_ONCE):
            if not working.in_time():
                break
            turns = range(first, min(first + _AT_ONCE, rounds))
            ends += working.each(Searcher.nearby, [beside(ends, turn) for turn in turns])
            ends = slimmed(ends, _CLOSELY)
        ends = _again(working, ends, rounds, told)
        best = leanest(ends, _CLOSELY)
        told.ahead = len(best)
        close = working.each(Searcher.closer, best, however_late=True)
    last = heapq.nsmallest(
        _LEANEST, ((count, k) for k, one in enumerate(close) for count in one.visited)
    )
    found = [close[k].simplified(close[k].visited[count]) for count, k in last]
    found.sort(key=lambda one: one.program.n_operations)
    return Found(found, front(ends + close), working.cut_short)


class _Told:
    """Tells how far it is.

    Args:
        progress: Told what share is done, and the fewest operations so far.
        ahead: Descents that are still to be made.
    """

    def __init__(self, progress: Callable[[float, str], None], ahead: int) -> None:
        self._progress, self.ahead = progress, ahead
        self._done, self._fewest = 0, np.inf

    def __call__(self, way: Way | None) -> None:
        """Of one more descent."""
        self._done, self.ahead = self._done + 1, self.ahead - 1
        self._fewest = min(self._fewest, np.inf if way is None else way.fewest)
        self._progress(self._done / (self._done + self.ahead), f"{self._fewest} operations")

    def more(self, ahead: int) -> None:
        """So many descents are still to be made besides."""
        self.ahead += ahead


def _again(working: Hands, ends: list[Way], patience: int, told: _Told) -> list[Way]:
    """Down once more from shortly before the best ends, while in time, until so many in a row have brought nothing."""
    turn = since = 0
    while since < patience and working.in_time():
        best = leanest(ends, _BEST)
        some = [
            Again(best[k % len(best)], turn + k) for k in range(min(_AT_ONCE, patience - since))
        ]
        ends = slimmed(ends + working.each(Searcher.again, some), _CLOSELY)
        turn, since = turn + len(some), since + len(some)
        if min(way.fewest for way in ends) < best[0].fewest:
            told.more(since)
            since = 0
    return ends


def _first(searcher: Searcher, starts: Iterable[Start]) -> list[Descent]:
    """Descents from starts within the budget, as many as their operations allow."""
    begins: list[Descent] = []
    for one in map(searcher.begun, starts):
        if one.end.fit.within:
            begins.append(one)
            if len(begins) >= int(np.clip(_WORK / _work(searcher, begins), _FEWEST, _MOST)):
                break
    return begins


def _work(searcher: Searcher, descents: Sequence[Descent]) -> float:
    """Operations times torques of a program, as some have on the average."""
    torques = searcher.looked_at.samples.tau.shape[0]
    return float(np.mean([max(one.visited) for one in descents]) * torques)
