"""Local search by exchanges from many starts."""

from dataclasses import dataclass, field, replace

import numpy as np

from paramreduce_cli.records import IntArray, Progress, ProgressCallback
from paramreduce_cli.reduction.heuristics.backward_elimination import backward_elimination
from paramreduce_cli.reduction.heuristics.forward_selection import forward_selection
from paramreduce_cli.reduction.heuristics.forward_selection_2 import forward_selection_2
from paramreduce_cli.reduction.heuristics.torque_only.qr import qr
from paramreduce_cli.reduction.objective import Objective, Subset
from paramreduce_cli.reduction.problem import TIE
from paramreduce_cli.reduction.task import Effort, FoundSubsets, SelectionTask, run, sort_by_size

_KICKED = 3
"""Parameters that a random change replaces."""


def swap(task: SelectionTask) -> FoundSubsets:
    """Swap one parameter for another as long as that lowers the criterion, from many starts.

    Starts are the results of forward selection, backward elimination and QR, the best subsets of the neighbouring sizes
    with a parameter more or less, and random changes of the best subset. A criterion that is costly to evaluate starts
    from the results of the swap search by torque, and from its own forward selection.
    """
    search = _SwapSearch(task.objective, task.smallest, task.limit)
    cheap = task.objective.cheap
    if cheap is None:
        for start in (forward_selection, forward_selection_2, backward_elimination, qr):
            search.offer_all(start(replace(task, effort=Effort())).subsets)
    else:
        search.offer_all(run("swap", replace(task, objective=cheap)).subsets)
        search.offer_all(forward_selection(task).subsets)
    search.extend_to_neighbours()
    if cheap is None:
        search.kick(task.effort.kicks, np.random.default_rng(task.effort.seed), task.progress)
    return sort_by_size(task.objective, search.best.values())


@dataclass
class _SwapSearch:
    """A search that stores the best subset of each number of columns."""

    objective: Objective
    smallest: int
    limit: int
    best: dict[int, Subset] = field(default_factory=dict)
    _scores: dict[int, float] = field(default_factory=dict)
    _seen: set[frozenset[int]] = field(default_factory=set)

    def offer_all(self, subsets: tuple[IntArray, ...]) -> None:
        """Improve subsets of columns, and keep the best of each size."""
        for subset in subsets:
            if self.smallest <= len(subset) <= self.limit:
                self.offer(self.objective.find_groups(subset))

    def offer(self, kept: Subset) -> bool:
        """Improve a subset by swaps, and return whether it is better than the best of its size."""
        n = self.objective.count_columns(kept)
        known = self._scores.get(n, np.inf)
        if known <= self.objective.negligible or frozenset(kept) in self._seen:
            return False
        self._seen.add(frozenset(kept))
        kept, score = self.objective.improve(kept)
        self._seen.add(frozenset(kept))
        if n in self.best and not score < known * (1 - TIE):
            return False
        self.best[n], self._scores[n] = kept, score
        return True

    def extend_to_neighbours(self) -> None:
        """Add a group to the best subsets or remove one, until no size gets better."""
        while True:
            better = [self._offer_longer(n) for n in sorted(self.best)]
            better += [self._offer_shorter(n) for n in sorted(self.best, reverse=True)]
            if not any(better):
                return

    def _offer_longer(self, n: int) -> bool:
        """Offer the best subset of a size with one group more."""
        longer = self.objective.add_best(self.best[n], self.limit)
        wide = self.objective.count_columns(longer)
        return n < wide <= self.limit and self.offer(longer)

    def _offer_shorter(self, n: int) -> bool:
        """Offer the best subset of a size with one group less."""
        kept = self.best[n]
        if len(kept) == 1:
            return False
        shorter = self.objective.remove_worst(kept)
        return self.objective.count_columns(shorter) >= self.smallest and self.offer(shorter)

    def kick(
        self, times: int, random: np.random.Generator, report_progress: ProgressCallback
    ) -> None:
        """Replace a few parameters by random ones, and improve the result."""
        everything = np.arange(len(self.objective.groups))
        better = False
        for done, n in enumerate(sorted(self.best)):
            report_progress(Progress("random changes", done, len(self.best)))
            for _ in range(times):
                kept = np.array(self.best[n])
                rest = np.setdiff1d(everything, kept)
                count = min(_KICKED, kept.size, rest.size)
                out = random.choice(kept.size, count, replace=False)
                kept[out] = random.choice(rest, count, replace=False)
                same = self.objective.count_columns(tuple(kept.tolist())) == n
                better |= bool(same and self.offer(tuple(kept.tolist())))
        report_progress(Progress("random changes", len(self.best), len(self.best)))
        if better:
            self.extend_to_neighbours()
