"""Base class of criteria: the score of a subset, and estimates of what adding or removing a group does.

Heuristics keep and drop groups: one column each, or several that belong together. Groups are numbered in order of
preference; a subset is a tuple of these numbers.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property

import numpy as np

from paramreduce_cli.records import FloatArray, IntArray
from paramreduce_cli.reduction.fitting import Fit, fit
from paramreduce_cli.reduction.problem import FULL_PRECISION, TIE, SelectionProblem, find_first_best

Subset = tuple[int, ...]


class Objective(ABC):
    """A base class of criteria, on one estimation set.

    Args:
        problem: The weighted least-squares problem that torques are fitted with.
    """

    negligible = FULL_PRECISION
    """Scores not above this cannot be improved."""

    def __init__(self, problem: SelectionProblem) -> None:
        self.problem = problem
        self.groups = problem.groups
        self.widths = np.array([group.size for group in self.groups])
        self.single = bool((self.widths == 1).all())

    @cached_property
    def owner(self) -> IntArray:
        """Group of each column of ``problem.columns``, (n_candidates,)."""
        return np.repeat(np.arange(self.widths.size), self.widths)

    def average_by_group(self, values: FloatArray) -> FloatArray:
        """Return the mean over the columns of each group, (n_groups,)."""
        if self.single:
            return values
        return np.bincount(self.owner, values, self.widths.size) / self.widths

    @abstractmethod
    def score(self, kept: Subset) -> float:
        """Return the quantity that the criterion minimises."""

    @abstractmethod
    def estimate_gains(self, kept: Subset) -> FloatArray:
        """Return the benefit of adding each group, per column, (n_groups,); -inf if the group must not be added or was not
        evaluated. Higher is better; only comparisons count.
        """

    @abstractmethod
    def estimate_losses(self, kept: Subset) -> FloatArray:
        """Return the cost of removing each group, per column, (n_groups,); inf if the group must not be removed or was not
        evaluated.
        """

    @abstractmethod
    def swap_best(self, kept: Subset) -> Subset:
        """Return the subset after the best swap of one group for another of the same width, or the subset itself if no
        swap helps.

        The subset itself is returned if no swap is promising.
        """

    @cached_property
    def largest(self) -> int:
        """Number of columns beyond which nothing is to be gained."""
        return int(self.widths.sum())

    @property
    def cheap(self) -> Objective | None:
        """A criterion that is quicker to search with and whose subsets are good starts, or None."""
        return None

    def fit(self, subset: IntArray) -> Fit:
        """Fit the parameters of a subset of columns."""
        return fit(self.problem, subset)

    def list_columns(self, kept: Subset) -> IntArray:
        """Return the columns of a subset, in the order in which they were added."""
        return np.concatenate([np.zeros(0, np.int64), *(self.groups[u] for u in kept)])

    def count_columns(self, kept: Subset) -> int:
        """Return the number of a subset's columns."""
        return len(kept) if self.single else int(self.widths[list(kept)].sum())

    def find_groups(self, columns: IntArray) -> Subset:
        """Return the groups of a subset of columns, in their order."""
        owner = {int(c): k for k, group in enumerate(self.groups) for c in group}
        return tuple(dict.fromkeys(owner[int(c)] for c in columns))

    def add_best(self, kept: Subset, most: int) -> Subset:
        """Return the subset with the group appended whose estimated gain per column is largest, or the subset itself if
        no group fits or all are ruled out.

        Args:
            kept: Subset of groups.
            most: Largest number of columns that the new subset may have.
        """
        room = most - self.count_columns(kept)
        if room <= 0:
            return kept
        gains = self.estimate_gains(kept)
        if not self.single:
            gains = np.where(self.widths <= room, gains, -np.inf)
        best = find_first_best(gains)
        return (*kept, best) if gains[best] > -np.inf else kept

    def remove_worst(self, kept: Subset) -> Subset:
        """Return the subset without the group whose removal costs least; of equal groups the least preferred is removed."""
        losses = self.estimate_losses(kept)
        return remove_group(kept, losses.size - 1 - find_first_best(-losses[::-1]))

    def improve(self, kept: Subset) -> tuple[Subset, float]:
        """Swap kept and dropped groups of columns until no swap improves the score; return the subset and its score."""
        score = self.score(kept)
        while True:
            other = self.swap_best(kept)
            value = self.score(other) if other != kept else score
            if not value < score * (1 - TIE):
                return kept, score
            kept, score = other, value


def remove_group(kept: Subset, group: int) -> Subset:
    """Return a subset without one of its groups."""
    return tuple(u for u in kept if u != group)
