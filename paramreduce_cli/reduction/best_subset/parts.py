"""One search in parts that threads take side by side: a branch that waits becomes a search itself."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np

from paramreduce_cli.records import IntArray
from paramreduce_cli.reduction.best_subset.search import Search

_NEXT = np.iinfo(np.int64).max
"""Stands between the logs of two parts."""


class PartedSearch:
    """A search for one size, split as often as threads ask for work.

    Args:
        search: Makes a search that goes on from a log.
        log: Of all parts that were open when an earlier search was left; empty at the beginning.
    """

    def __init__(self, search: Callable[[IntArray], Search], log: IntArray) -> None:
        self._open = [search(part) for part in _taken_apart(log)]
        self._ended: list[Search] = []
        self._best = self._open[0]

    def advance(self, nodes: int, threads: int) -> None:
        """Go on for at most so many nodes on every thread; what one finds, all know afterwards."""
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
            part.learn(self.squared_error, self.subset)

    def _split(self) -> Search | None:
        return next((new for part in self._open if (new := part.split()) is not None), None)

    @property
    def finished(self) -> bool:
        """Whether nothing is left to search."""
        return not self._open

    @property
    def nodes(self) -> int:
        """Nodes visited by all parts."""
        return sum(part.nodes for part in self._parts())

    @property
    def squared_error(self) -> float:
        """Of the best subset found, a share of that of chi."""
        return self._best.squared_error

    @property
    def subset(self) -> IntArray:
        """The best subset found, numbered as the columns of the problem."""
        return self._best.subset

    @property
    def doubtful(self) -> bool:
        """Whether some part proves nothing; see :attr:`Search.doubtful`."""
        return any(part.doubtful for part in self._parts())

    @property
    def bound(self) -> float:
        """Squared error that no subset is below, as far as all parts have come."""
        return min(part.bound for part in self._open or [self._best])

    @property
    def log(self) -> IntArray:
        """Where all open parts stand, to go on from there another time."""
        if not self._open:
            return np.zeros(0, np.int64)
        return np.concatenate([np.append(part.log, _NEXT) for part in self._open])[:-1]

    def _parts(self) -> list[Search]:
        return [*self._open, *self._ended]


def _taken_apart(log: IntArray) -> Iterator[IntArray]:
    ends = [-1, *np.flatnonzero(log == _NEXT).tolist(), log.size]
    for before, end in pairwise(ends):
        yield log[before + 1 : end]
