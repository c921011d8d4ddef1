"""One search in parts, for threads or for several jobs: a waiting branch becomes a search of its own."""

import heapq
import zlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import count, pairwise

import numpy as np

from paramreduce_cli.records import IntArray, Part
from paramreduce_cli.reduction.best_subset.subset_search import Search

_NEXT = np.iinfo(np.int64).max
"""Stands between the logs of two parts."""
_SUBTREES, _MOST_SUBTREES = 256, 2048
"""Dealt to each job, for all to have as much to do, and to all jobs together."""
_EASY = 2000
"""Nodes of a search that every job does by itself."""
_GLANCE = 1
"""Nodes after which a subtree is large enough to be split, or done."""


class PartedSearch:
    """A search for one size, split as often as threads ask for work.

    Args:
        search: Function that makes a search that continues from a log.
        log: State of all parts that an earlier search left open; empty at the beginning.
    """

    def __init__(self, search: Callable[[IntArray], Search], log: IntArray) -> None:
        self._open = [search(part) for part in split_log(log)]
        self._ended: list[Search] = []
        self._best = self._open[0]
        self._glances = 0

    def advance(self, nodes: int, threads: int) -> None:
        """Go on for a limited number of nodes on every thread; better subsets of one are known to all afterwards."""
        while len(self._open) < threads and (new := self._split()) is not None:
            self._open.append(new)
        at_once = self._open[:threads]
        if len(at_once) == 1:
            at_once[0].advance(nodes)
        else:
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(lambda part: part.advance(nodes), at_once))
        self._best = min(self._open, key=lambda part: part.squared_error)
        self._ended += [part for part in at_once if part.finished]
        self._open = [part for part in self._open if not part.finished]
        for part in self._open:
            part.take_incumbent(self.squared_error, self.subset)

    def _split(self) -> Search | None:
        return next((new for part in self._open if (new := part.split()) is not None), None)

    def deal(self, job: Part) -> int:
        """Keep some of the subtrees that the search is split into, for other jobs to take the others.

        The subtrees nearest to the root are split first, until there are many. Every job repeats the search up to the
        subtrees, and easy searches as a whole. The subtrees are distributed round-robin, those of the lowest bounds
        first.

        Returns:
            A digest of all subtrees: jobs with the same one have the same cards; 0 where there are none.
        """
        (whole,) = self._open
        whole.advance(_EASY)
        if whole.finished:
            self._ended, self._open = [whole], []
            return 0
        many = min(_SUBTREES * job.count, _MOST_SUBTREES)
        number = count()  # older ones first where depths are equal
        heap = [(0, next(number), part) for part in self._open]
        while 0 < len(heap) < many:
            _, _, part = heapq.heappop(heap)
            for one in (part, part.split()):
                if one is None:
                    continue
                while one.depth is None and not one.finished:
                    one.advance(_GLANCE)
                if one.depth is None:
                    self._ended.append(one)
                else:
                    heapq.heappush(heap, (one.depth, next(number), one))
        cards = [part for _, _, part in sorted(heap, key=lambda card: (card[2].bound, card[1]))]
        self._best = min([*cards, *self._ended], key=lambda part: part.squared_error)
        self._glances = sum(part.nodes for part in cards)
        self._open = job.select(cards)
        self._glances -= sum(part.nodes for part in self._open)
        self.take_incumbent(self.squared_error, self.subset)
        return zlib.crc32(b"".join(part.log.tobytes() for part in cards))

    def take_incumbent(self, squared_error: float, subset: IntArray) -> None:
        """Take over a better subset that another search of the same size has found."""
        for part in self._open:
            part.take_incumbent(squared_error, subset)

    @property
    def finished(self) -> bool:
        """Whether nothing is left to search."""
        return not self._open

    @property
    def nodes(self) -> int:
        """Nodes visited by all parts, and in subtrees that are other jobs'."""
        return sum(part.nodes for part in self._list_parts()) + self._glances

    @property
    def squared_error(self) -> float:
        """Squared error of the best subset found, as a share of that of chi."""
        return self._best.squared_error

    @property
    def subset(self) -> IntArray:
        """Best subset found, numbered as the columns of the problem."""
        return self._best.subset

    @property
    def is_uncertain(self) -> bool:
        """Whether some part proves nothing; see :attr:`Search.is_uncertain`."""
        return any(part.is_uncertain for part in self._list_parts())

    @property
    def bound(self) -> float:
        """Lower bound on the squared error of every subset, as far as all parts have come."""
        return min(part.bound for part in self._open or [self._best])

    @property
    def log(self) -> IntArray:
        """Positions of all open parts, from which the search can continue later."""
        return concatenate_logs([part.log for part in self._open])

    def _list_parts(self) -> list[Search]:
        return [*self._open, *self._ended]


def concatenate_logs(logs: Sequence[IntArray]) -> IntArray:
    """Return the logs of several searches as one; empty logs are skipped."""
    logs = [log for log in logs if log.size]
    if not logs:
        return np.zeros(0, np.int64)
    return np.concatenate([np.append(log, _NEXT) for log in logs])[:-1]


def split_log(log: IntArray) -> Iterator[IntArray]:
    """Yield the logs of the single searches in a log."""
    ends = [-1, *np.flatnonzero(log == _NEXT).tolist(), log.size]
    for before, end in pairwise(ends):
        yield log[before + 1 : end]
