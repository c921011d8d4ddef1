"""Search for the leanest program of one function within a budget, by removing terms."""

from __future__ import annotations

import heapq
import math
import time
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from paramreduce_cli.resources.processes import Item
from paramreduce_cli.terms.descent import (
    Descent,
    SearchHistory,
    Simplified,
    draw_history,
    drop_candidates,
    find_leanest_histories,
    list_front,
)
from paramreduce_cli.terms.parallel_descents import (
    NearbyStart,
    Restart,
    Searcher,
    WorkerGroup,
    start_searchers,
)
from paramreduce_cli.terms.starts import Start, order_by_estimate

_LOOKED_AT = 200
"""Starts that are looked at to find the smallest one within the budget, at most."""
_WORK = 40_000
"""Operations times torques, of all programs that are gone down from first: time grows a little faster."""
_FEWEST, _MOST = 12, 30
"""How many these are at the least, and at most."""
_BEST = 4
"""Starts with the leanest ends, near which others are gone down from."""
_DRAWN = 0.25
"""How often this is done near one of all, so that what is no better at once is gone on from too."""
_AT_ONCE = 8
"""Descents before the best are looked for again."""
_HARDLY = 200
"""One operation in so many: what brings less than that brings nothing."""
_CLOSELY = 8
"""Leanest ends of all descents, gone on from with more samples."""
_MANY = 20_000
"""Operations times torques, of all programs that are gone down from at the least, from which on the start of processes pays."""
_LEANEST = 12
"""Programs that are judged, the leanest of all searches."""


class Found(NamedTuple):
    """The result of a search: no programs if no start is within the budget."""

    ends: list[Simplified]
    """Programs, the leanest first."""
    front: list[Simplified]
    """Programs on the way to them, by operations."""
    cut_short: bool = False
    """Whether its time was over before it was."""


def simplify(
    searcher: Searcher,
    starts: list[Start],
    *,
    max_rounds: int,
    seconds: float = math.inf,
    jobs: int = 1,
    progress: Callable[[float, str], None] = lambda *_: None,
) -> Found:
    """Remove terms and replace nodes as long as errors stay within a budget.

    Descents begin at the starts, then near the best ends with formulations changed at random, then from programs
    shortly before the best ends, written in other ways; the best ends are finished with more samples.

    Args:
        searcher: Goes down from them.
        starts: Subsets, the smallest first; how many are gone down from depends on their operations.
        max_rounds: Number of descents in a row that may bring nothing, near the best ends and from shortly before them.
        seconds: Time after which no more descents begin, except for the last ones with more samples; results then depend on the machine.
        jobs: Processes; what is found in time does not depend on them.
        progress: Called with the finished fraction and the fewest operations so far.

    Raises:
        DataError: A process died.
    """
    deadline = time.monotonic() + seconds
    every = map(searcher.start_descent, starts[:_LOOKED_AT])
    smallest = next((one.start for one in every if one.end.fit.within), None)
    if smallest is None:
        return Found([], [])
    begins = _list_first(searcher, order_by_estimate(starts, smallest.model.n))
    meter = _ProgressMeter(progress, len(begins) + 2 * max_rounds + _CLOSELY)

    def start_nearby(ends: Sequence[SearchHistory], turn: int) -> NearbyStart:
        """Return a start near one of the best ends."""
        rng = np.random.default_rng([searcher.seed, turn, 1])
        best = find_leanest_histories(ends, _BEST)
        parent = best[turn % len(best)] if rng.random() > _DRAWN else draw_history(ends, rng)
        return NearbyStart(parent.start, [one.start for one in best], turn)

    def start_again(ends: Sequence[SearchHistory], turn: int) -> Restart:
        """Return a restart from shortly before one of the best ends."""
        best = find_leanest_histories(ends, _BEST)
        return Restart(best[turn % len(best)], turn)

    pays = meter.ahead * _estimate_work(searcher, begins) > _MANY
    with start_searchers(searcher, jobs if pays else 1, meter, deadline) as working:
        ends = working.map(Searcher.descend, [one.start for one in begins])
        ends = _descend_further(
            working, ends, Searcher.descend_nearby, start_nearby, max_rounds, meter
        )
        ends = _descend_further(
            working, ends, Searcher.repeat_descent, start_again, max_rounds, meter
        )
        best = find_leanest_histories(ends, _CLOSELY)
        meter.ahead = len(best)
        close = working.map(Searcher.descend_closely, best, however_late=True)
    last = heapq.nsmallest(
        _LEANEST, ((count, k) for k, one in enumerate(close) for count in one.visited)
    )
    found = [close[k].rebuild(close[k].visited[count]) for count, k in last]
    found.sort(key=lambda one: one.program.n_operations)
    return Found(found, list_front(ends + close), working.cut_short)


class _ProgressMeter:
    """A meter of the progress of a search.

    Args:
        progress: Called with the finished fraction and the fewest operations so far.
        ahead: Descents that are still to be made.
    """

    def __init__(self, progress: Callable[[float, str], None], ahead: int) -> None:
        self._progress, self.ahead = progress, ahead
        self._done, self._fewest = 0, np.inf

    def __call__(self, history: SearchHistory | None) -> None:
        """Count one more descent."""
        self._done, self.ahead = self._done + 1, self.ahead - 1
        self._fewest = min(self._fewest, np.inf if history is None else history.fewest)
        self._progress(self._done / (self._done + self.ahead), f"{self._fewest} operations")

    def expect(self, ahead: int) -> None:
        """Add to the number of descents that are still to be made."""
        self.ahead += ahead


def _descend_further(
    working: WorkerGroup,
    ends: list[SearchHistory],
    work: Callable[[Searcher, Item], SearchHistory | None],
    item: Callable[[Sequence[SearchHistory], int], Item],
    patience: int,
    meter: _ProgressMeter,
) -> list[SearchHistory]:
    """Make further descents, while in time, until a number of them in a row have improved nothing.

    Args:
        working: Worker group that makes the descents.
        ends: Ends of the earlier descents.
        work: Work on an item.
        item: Function that makes an item from the earlier ends and its number.
        patience: Number of descents in a row that save less than half a percent of the operations, after which no more
            of these descents are made.
        meter: Progress meter.
    """
    first = since = 0
    fewest = _find_fewest(ends)
    while since < patience and working.is_in_time():
        turns = range(first, first + min(_AT_ONCE, patience - since))
        ends = drop_candidates(ends + working.map(work, [item(ends, k) for k in turns]), _CLOSELY)
        first, since = turns.stop, since + len(turns)
        saved = fewest - _find_fewest(ends)
        if saved and saved * _HARDLY >= fewest:
            meter.expect(since)
            since, fewest = 0, fewest - saved
    return ends


def _find_fewest(ends: Iterable[SearchHistory]) -> int:
    return min(history.fewest for history in ends)


def _list_first(searcher: Searcher, starts: Iterable[Start]) -> list[Descent]:
    """Return the first descents, from starts within the budget; large programs get fewer."""
    begins: list[Descent] = []
    for one in map(searcher.start_descent, starts):
        if one.end.fit.within:
            begins.append(one)
            if len(begins) >= int(
                np.clip(_WORK / _estimate_work(searcher, begins), _FEWEST, _MOST)
            ):
                break
    return begins


def _estimate_work(searcher: Searcher, descents: Sequence[Descent]) -> float:
    """Return the number of operations times that of torques, averaged over descents: a measure of how long a descent
    takes.
    """
    torques = searcher.search_samples.samples.tau.shape[0]
    return float(np.mean([max(one.visited) for one in descents]) * torques)
