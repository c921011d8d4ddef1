"""Backward Elimination [Ros2019], Algorithm 1."""

from paramreduce_cli.reduction.objective import Subset, remove_group
from paramreduce_cli.reduction.task import FoundSubsets, SelectionTask, make_nested


def backward_elimination(task: SelectionTask) -> FoundSubsets:
    """Remove, one by one, the parameter whose removal raises the criterion least.

    While columns are dependent, many removals cost nothing, and their order decides which subsets can be reached later.
    The parameter with the smallest torques in the minimum-norm fit is then removed first; of equal ones the least
    preferred.
    """
    left: Subset = tuple(range(len(task.objective.groups)))
    order: Subset = ()
    while left:
        fewer = task.objective.remove_worst(left)
        (removed,) = set(left) - set(fewer)
        left, order = remove_group(left, removed), (removed, *order)
    return make_nested(task, order)
