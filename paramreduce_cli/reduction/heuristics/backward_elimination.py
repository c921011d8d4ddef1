"""Backward Elimination [Ros2019], Algorithm 1."""

from paramreduce_cli.reduction.objective import Subset, remove_group
from paramreduce_cli.reduction.task import FoundSubsets, SelectionTask, make_nested


def backward_elimination(task: SelectionTask) -> FoundSubsets:
    """Remove, one by one, the parameter whose removal raises the criterion least.

    As long as columns are dependent many removals are free. Which of them comes first decides
    what can be reached later, so it is not left to chance: of the free ones the parameter goes
    that causes the smallest torques in the fit of least norm. Ties remove the least preferred.
    """
    left: Subset = tuple(range(len(task.objective.groups)))
    order: Subset = ()
    while left:
        fewer = task.objective.remove_worst(left)
        (removed,) = set(left) - set(fewer)
        left, order = remove_group(left, removed), (removed, *order)
    return make_nested(task, order)
