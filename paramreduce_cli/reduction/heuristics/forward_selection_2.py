"""Forward Selection with two iterations [Ros2019], Algorithm 3."""

from paramreduce_cli.reduction.objective import without
from paramreduce_cli.reduction.task import FoundSubsets, SelectionTask, by_size, completed


def forward_selection_2(task: SelectionTask) -> FoundSubsets:
    """Add the best parameter, remove the one added in the pass before, and add the best again.

    The first pass only adds. (As [Ros2019] prints Algorithm 3 it lacks the second addition, which
    its text describes.) Subsets are not nested.
    """
    objective = task.objective
    kept = objective.with_best((), task.limit)
    subsets = [kept]
    while (longer := objective.with_best(kept, task.limit)) != kept:
        renewed = objective.with_best(without(longer, kept[-1]), task.limit)
        # With groups the parameter that comes back may be wider or narrower.
        kept = renewed if objective.width(renewed) > objective.width(kept) else longer
        subsets.append(kept)
    rest = completed(objective, kept)
    subsets += [rest[:k] for k in range(len(kept) + 1, len(rest) + 1)]
    return by_size(objective, [s for s in subsets if s and objective.width(s) <= task.limit])
