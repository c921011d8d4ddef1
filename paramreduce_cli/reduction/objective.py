"""What a heuristic asks of a criterion: how good a subset is, and what adding or removing does.

Heuristics work on units, a column or a group each, numbered in order of preference; a subset
is a tuple of units in the order in which they were taken.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property

import numpy as np

from paramreduce_cli.records import FloatArray, IntArray
from paramreduce_cli.reduction.fitting import Fit, fit
from paramreduce_cli.reduction.problem import (
    FULL_PRECISION,
    TIE,
    SelectionProblem,
    first_of_the_best,
)

Units = tuple[int, ...]


class Objective(ABC):
    """A criterion on one estimation set.

    Args:
        problem: The weighted least-squares problem that torques are fitted with.
    """

    negligible = FULL_PRECISION
    """Scores not above this cannot be improved."""

    def __init__(self, problem: SelectionProblem) -> None:
        self.problem = problem
        self.units = problem.units
        self.widths = np.array([unit.size for unit in self.units])
        self.single = bool((self.widths == 1).all())

    @cached_property
    def owner(self) -> IntArray:
        """Unit of each column of ``problem.columns``, (n_candidates,)."""
        return np.repeat(np.arange(self.widths.size), self.widths)

    def per_unit(self, values: FloatArray) -> FloatArray:
        """What the columns of each unit have, averaged over its columns, (n_units,)."""
        if self.single:
            return values
        return np.bincount(self.owner, values, self.widths.size) / self.widths

    @abstractmethod
    def score(self, kept: Units) -> float:
        """What is minimised."""

    @abstractmethod
    def gains(self, kept: Units) -> FloatArray:
        """How much each unit is worth, per column, if it is added; -inf if it must not be.

        Higher is better; only comparisons count. (n_units,)
        """

    @abstractmethod
    def losses(self, kept: Units) -> FloatArray:
        """What the removal of each unit costs, per column; inf if it must not go, (n_units,)."""

    @abstractmethod
    def exchanged(self, kept: Units) -> Units:
        """The subset after the best exchange of one unit for another of the same width.

        The subset itself where none is promising.
        """

    @cached_property
    def largest(self) -> int:
        """Number of columns beyond which nothing is to be gained."""
        return int(self.widths.sum())

    @property
    def cheap(self) -> Objective | None:
        """A criterion that is quicker to search with and whose subsets are good starts."""
        return None

    def fit(self, subset: IntArray) -> Fit:
        """Values of the parameters kept."""
        return fit(self.problem, subset)

    def columns(self, kept: Units) -> IntArray:
        """Columns of a subset, in the order in which they were taken."""
        return np.concatenate([np.zeros(0, np.int64), *(self.units[u] for u in kept)])

    def width(self, kept: Units) -> int:
        """Number of its columns."""
        return len(kept) if self.single else int(self.widths[list(kept)].sum())

    def units_of(self, columns: IntArray) -> Units:
        """Units of a subset of columns, in their order."""
        owner = {int(c): k for k, unit in enumerate(self.units) for c in unit}
        return tuple(dict.fromkeys(owner[int(c)] for c in columns))

    def with_best(self, kept: Units, most: int) -> Units:
        """The subset with the unit that is worth most; itself where nothing may be added.

        Args:
            kept: The subset.
            most: Columns it may have then.
        """
        room = most - self.width(kept)
        if room <= 0:
            return kept
        gains = self.gains(kept)
        if not self.single:
            gains = np.where(self.widths <= room, gains, -np.inf)
        best = first_of_the_best(gains)
        return (*kept, best) if gains[best] > -np.inf else kept

    def without_least(self, kept: Units) -> Units:
        """The subset without the unit that costs least; ties remove the least preferred."""
        losses = self.losses(kept)
        return without(kept, losses.size - 1 - first_of_the_best(-losses[::-1]))

    def improved(self, kept: Units) -> tuple[Units, float]:
        """Exchange until nothing improves; the subset and its score."""
        score = self.score(kept)
        while True:
            other = self.exchanged(kept)
            value = self.score(other) if other != kept else score
            if not value < score * (1 - TIE):
                return kept, score
            kept, score = other, value


def without(kept: Units, unit: int) -> Units:
    """A subset without one of its units."""
    return tuple(u for u in kept if u != unit)
