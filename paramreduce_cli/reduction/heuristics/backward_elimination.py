"""Backward Elimination [Ros2019], Algorithm 1, from one base set or from several."""

from collections.abc import Iterator
from itertools import islice

import numpy as np

from paramreduce_cli.multibody.orthogonal import DEPENDENT, independent_columns
from paramreduce_cli.records import IntArray
from paramreduce_cli.reduction.objective import Objective, Units, without
from paramreduce_cli.reduction.task import FoundSubsets, SelectionTask, by_size, completed, nested


def backward_elimination(task: SelectionTask) -> FoundSubsets:
    """Remove, one by one, the parameter whose loss costs least.

    As long as columns are dependent many removals are free. Which of them comes first decides
    what can be reached later, so it is not left to chance: of the free ones the parameter goes
    that causes the smallest torques in the fit of least norm. Further base sets to start from are
    the preferred one, then random ones; each size keeps the best subset of all starts. Ties
    remove the least preferred.
    """
    objective, effort = task.objective, task.effort
    orders = [
        _eliminated(objective, start)
        for start in islice(_starts(objective, effort.seed), effort.base_sets)
    ]
    if len(orders) == 1 and not effort.continue_with_swaps:
        return nested(task, orders[0])
    best: dict[int, tuple[float, Units]] = {}
    for order in orders:
        for k in range(1, len(order) + 1):
            kept = order[:k]
            n = objective.width(kept)
            if n > task.limit:
                break
            found = (kept, objective.score(kept))
            if effort.continue_with_swaps:
                found = objective.improved(kept)
            if n not in best or found[1] < best[n][0]:
                best[n] = (found[1], found[0])
    return by_size(objective, [kept for _, kept in best.values()])


def _starts(objective: Objective, seed: int) -> Iterator[Units]:
    """All units, then those of base sets."""
    everything = tuple(range(len(objective.units)))
    yield everything
    yield _base(objective, np.arange(len(everything)))
    random = np.random.default_rng(seed)
    while True:
        yield _base(objective, random.permutation(len(everything)))


def _base(objective: Objective, order: IntArray) -> Units:
    """Units taken in an order, those left out that depend on the others altogether."""
    columns = objective.columns(tuple(order.tolist()))
    independent = independent_columns(objective.problem.W, columns, DEPENDENT)
    return tuple(sorted(objective.units_of(np.array(independent))))


def _eliminated(objective: Objective, start: Units) -> Units:
    """All units, the last removed first; those that are not in the start come last."""
    left, tail = start, completed(objective, start)[len(start) :]
    while left:
        fewer = objective.without_least(left)
        (gone,) = set(left) - set(fewer)
        left, tail = without(left, gone), (gone, *tail)
    return tail
