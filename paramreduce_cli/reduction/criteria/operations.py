"""The cost of evaluating a model as a criterion, under a limit of the torque error."""

from collections.abc import Callable
from functools import cached_property

import numpy as np

from paramreduce_cli.records import FloatArray, IntArray
from paramreduce_cli.reduction.criteria.torque import TorqueObjective
from paramreduce_cli.reduction.inputs import CriterionInputs
from paramreduce_cli.reduction.objective import Objective, Units, without
from paramreduce_cli.reduction.problem import SelectionProblem

_WEIGHT = 3.0
"""Price of an error above the limit: one per cent of the error costs this many per cent of the
full model's operations."""
_PROPOSALS = 25
_MORE = 4
"""More parameters than are needed may still save operations."""


class OperationsObjective(Objective):
    """Operations as a share of the full model's, plus a penalty for errors above the limit.

    Args:
        problem: The weighted least-squares problem that torques are fitted with.
        cost: Operations of a model of some columns.
        limit: Torque error that is allowed.
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
        """A few more than greedy selection by torque needs to keep the limit."""
        kept: Units = ()
        while self._torque.score(kept) > self._limit:
            longer = self._torque.with_best(kept, super().largest)
            if longer == kept:
                break
            kept = longer
        return min(super().largest, self.width(kept) + _MORE)

    @property
    def cheap(self) -> Objective:
        """The torque error of the same subsets."""
        return self._torque

    def operations(self, kept: Units) -> int:
        """Of the model that keeps these units."""
        key = frozenset(kept)
        if not kept:
            return 0
        if key not in self._costs:
            self._costs[key] = self._cost(np.sort(self.columns(kept)))
        return self._costs[key]

    def score(self, kept: Units) -> float:
        """Share of the operations, plus the penalty."""
        return self.operations(kept) / self._all + self._penalty(self._torque.score(kept))

    def _penalty(self, error: float) -> float:
        return _WEIGHT * max(0.0, float(np.log(max(error, 1e-300) / self._limit)))

    def gains(self, kept: Units) -> FloatArray:
        """How much of the error goes for the operations a unit costs; once the limit is kept, the
        cheapest.
        """
        gains = self._torque.gains(kept)
        result = np.full(gains.size, -np.inf)
        now, error = self.operations(kept), self._torque.score(kept)
        for unit in np.flatnonzero(gains > -np.inf).tolist():
            more = 1 + max(0, self.operations((*kept, unit)) - now)
            if error > self._limit:
                squared = max(error**2 - max(gains[unit], 0.0) * self.widths[unit], 1e-300)
                result[unit] = (np.log(error) - np.log(squared) / 2) / more
            else:
                result[unit] = -more / self.widths[unit]
        return result

    def losses(self, kept: Units) -> FloatArray:
        """Rise of the squared error for every operation that a removal saves; removals that break
        the limit come after all others, by the error they leave.
        """
        costs = self._torque.losses(kept)
        result = np.full(costs.size, np.inf)
        now, error = self.operations(kept), self._torque.score(kept)
        for unit in kept:
            if costs[unit] == np.inf:
                continue
            squared = error**2 + costs[unit] * self.widths[unit]
            saved = 0.5 + max(0, now - self.operations(without(kept, unit)))
            over = squared > max(self._limit, error) ** 2
            result[unit] = 1.0 + squared if over else (squared - error**2) / saved
        return result

    def exchanged(self, kept: Units) -> Units:
        """The best of the exchanges that promise few operations and keep the limit.

        What an exchange changes is taken for the sum of what its removal and its addition change.
        """
        allowed = max(self._limit, 1.05 * self._torque.score(kept))
        exchanges = self._torque.exchanges_within(kept, allowed)
        now = self.operations(kept)
        less = {
            u: now - self.operations(without(kept, u)) for u in {out for out, _, _ in exchanges}
        }
        more = {u: self.operations((*kept, u)) - now for u in {into for _, into, _ in exchanges}}

        def promise(exchange: tuple[int, int, float]) -> float:
            out, into, error = exchange
            return (more[into] - less[out]) / self._all + self._penalty(error)

        best = sorted(exchanges, key=promise)[:_PROPOSALS]
        proposals = [(*without(kept, out), into) for out, into, _ in best]
        return min([kept, *proposals], key=self.score)


def operations(problem: SelectionProblem, inputs: CriterionInputs) -> Objective:
    """The fewest operations under a limit of the torque error."""
    return OperationsObjective(problem, inputs.cost, inputs.error_limit)
