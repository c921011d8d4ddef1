"""What a heuristic asks of a criterion: how good a subset is, and what adding or removing does.

Heuristics work on units, a column or a group each, numbered in order of preference; a subset
is a tuple of units in the order in which they were taken.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

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
        self.units = problem.units()
        self.widths = np.array([unit.size for unit in self.units])

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

    @property
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
        return int(self.widths[list(kept)].sum())

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
        gains = np.where(self.widths <= most - self.width(kept), self.gains(kept), -np.inf)
        if not np.any(gains > -np.inf):
            return kept
        return (*kept, first_of_the_best(gains))

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


class Means(ABC):
    """What criteria may need besides the least-squares problem."""

    error_limit: float
    """Torque error under which the cost is minimised."""

    @abstractmethod
    def accelerations(self, most: int) -> Any:
        """AccelerationData of at most so many samples of the estimation set."""

    @abstractmethod
    def cost(self, kept: IntArray) -> int:
        """Operations of a model that keeps these columns."""
