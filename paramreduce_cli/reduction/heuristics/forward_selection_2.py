"""Forward Selection with two iterations [Ros2019], Algorithm 3."""

from paramreduce_cli.reduction.objective import remove_group
from paramreduce_cli.reduction.task import FoundSubsets, SelectionTask, append_others, sort_by_size


def forward_selection_2(task: SelectionTask) -> FoundSubsets:
    """Add the best parameter, remove the one added in the pass before, and add the best again.

    The first pass only adds. (Algorithm 3 as printed in [Ros2019] lacks the second addition that its text describes.)
    Subsets are not nested.
    """
    objective = task.objective
    kept = objective.add_best((), task.limit)
    subsets = [kept]
    while (longer := objective.add_best(kept, task.limit)) != kept:
        renewed = objective.add_best(remove_group(longer, kept[-1]), task.limit)
        # With groups the parameter that comes back may be wider or narrower.
        kept = (
            renewed if objective.count_columns(renewed) > objective.count_columns(kept) else longer
        )
        subsets.append(kept)
    rest = append_others(objective, kept)
    subsets += [rest[:k] for k in range(len(kept) + 1, len(rest) + 1)]
    return sort_by_size(
        objective, [s for s in subsets if s and objective.count_columns(s) <= task.limit]
    )
