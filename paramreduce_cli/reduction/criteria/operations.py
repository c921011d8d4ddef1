"""Criterion of the operations of a model, under a limit of the torque error."""

from collections.abc import Callable
from functools import cached_property

import numpy as np

from paramreduce_cli.records import FloatArray, IntArray
from paramreduce_cli.reduction.criteria.torque import TorqueObjective
from paramreduce_cli.reduction.inputs import CriterionInputs
from paramreduce_cli.reduction.objective import Objective, Subset, remove_group
from paramreduce_cli.reduction.problem import SelectionProblem

_WEIGHT = 3.0
"""Price of an error above the limit: one per cent of the error costs this many per cent of the
full model's operations."""
_PROPOSALS = 25
_MORE = 4
"""More parameters than are needed may still save operations."""


class OperationsObjective(Objective):
    """The operations as a share of the full model's, plus a penalty for errors above the limit.

    Args:
        problem: The weighted least-squares problem that torques are fitted with.
        cost: Function that returns the number of operations of a model, given its columns.
        limit: Torque error that is allowed, as a fraction.
    """

    def __init__(
        self, problem: SelectionProblem, cost: Callable[[IntArray], int], limit: float
    ) -> None:
        super().__init__(problem)
        self._torque = TorqueObjective(problem)
        self._cost = cost
        self._limit = limit
        self._all = max(1, cost(problem.candidates))
        self._costs: dict[frozenset[int], int] = {}

    @cached_property
    def largest(self) -> int:
        """Number of columns that greedy selection by torque needs for the limit, and a few more."""
        kept: Subset = ()
        while self._torque.score(kept) > self._limit:
            longer = self._torque.add_best(kept, super().largest)
            if longer == kept:
                break
            kept = longer
        return min(super().largest, self.count_columns(kept) + _MORE)

    @property
    def cheap(self) -> Objective:
        """Torque error of the same subsets, which is cheap to compute."""
        return self._torque

    def count_operations(self, kept: Subset) -> int:
        """Return the number of operations of the model that keeps these groups of columns."""
        key = frozenset(kept)
        if not kept:
            return 0
        if key not in self._costs:
            self._costs[key] = self._cost(np.sort(self.list_columns(kept)))
        return self._costs[key]

    def score(self, kept: Subset) -> float:
        """Return the number of operations as a share of the full model's, plus the penalty."""
        return self.count_operations(kept) / self._all + self._compute_penalty(
            self._torque.score(kept)
        )

    def _compute_penalty(self, error: float) -> float:
        return _WEIGHT * max(0.0, float(np.log(max(error, 1e-300) / self._limit)))

    def estimate_gains(self, kept: Subset) -> FloatArray:
        """Return the fall of the logarithmic error per operation of each group, while the error is above the limit;
        below the limit, minus the operations that the group adds per column.
        """
        gains = self._torque.estimate_gains(kept)
        result = np.full(gains.size, -np.inf)
        now, error = self.count_operations(kept), self._torque.score(kept)
        for group in np.flatnonzero(gains > -np.inf).tolist():
            more = 1 + max(0, self.count_operations((*kept, group)) - now)
            if error > self._limit:
                squared = max(error**2 - max(gains[group], 0.0) * self.widths[group], 1e-300)
                result[group] = (np.log(error) - np.log(squared) / 2) / more
            else:
                result[group] = -more / self.widths[group]
        return result

    def estimate_losses(self, kept: Subset) -> FloatArray:
        """Return the rise of the squared error per operation that a removal saves.

        Removals that exceed the limit come after all others, in order of the error they leave.
        """
        costs = self._torque.estimate_losses(kept)
        result = np.full(costs.size, np.inf)
        now, error = self.count_operations(kept), self._torque.score(kept)
        for group in kept:
            if costs[group] == np.inf:
                continue
            squared = error**2 + costs[group] * self.widths[group]
            saved = 0.5 + max(0, now - self.count_operations(remove_group(kept, group)))
            over = squared > max(self._limit, error) ** 2
            result[group] = 1.0 + squared if over else (squared - error**2) / saved
        return result

    def swap_best(self, kept: Subset) -> Subset:
        """Return the best subset among the swaps that promise the fewest operations, and the subset itself.

        Swaps may leave an error up to the limit, or up to 1.05 times the present error if that is larger. The
        operations of a swap are estimated as the sum of its removal and its addition.
        """
        allowed = max(self._limit, 1.05 * self._torque.score(kept))
        exchanges = self._torque.list_swaps_within(kept, allowed)
        now = self.count_operations(kept)
        less = {
            u: now - self.count_operations(remove_group(kept, u))
            for u in {out for out, _, _ in exchanges}
        }
        more = {
            u: self.count_operations((*kept, u)) - now for u in {into for _, into, _ in exchanges}
        }

        def estimate_score(swap: tuple[int, int, float]) -> float:
            """Return the estimated score after a swap."""
            out, into, error = swap
            return (more[into] - less[out]) / self._all + self._compute_penalty(error)

        best = sorted(exchanges, key=estimate_score)[:_PROPOSALS]
        proposals = [(*remove_group(kept, out), into) for out, into, _ in best]
        return min([kept, *proposals], key=self.score)


def operations(problem: SelectionProblem, inputs: CriterionInputs) -> Objective:
    """Return the criterion of the fewest operations under a limit of the torque error."""
    return OperationsObjective(problem, inputs.cost, inputs.error_limit)
