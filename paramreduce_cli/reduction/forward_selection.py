"""Forward Selection [Ros2019], Algorithms 2 and 3."""

from __future__ import annotations

from paramreduce_cli.reduction.objective import without
from paramreduce_cli.reduction.task import Found, Task, by_size, completed, nested
from paramreduce_cli.registry import heuristic


@heuristic("forward-selection")
def forward_selection(task: Task) -> Found:
    """Add, one by one, the parameter that is worth most.

    By torques that is the one that lowers the error most: for a column of which r is left after
    projecting out the subset, the squared error falls by (r . e)^2 / (r . r), e being what is left
    of the torques; for a group it is what its columns explain together, per column. Once nothing
    is left but round-off, the column of which the largest share is left comes next, so that the
    order goes on to a well-conditioned base; dependent columns follow in order of preference.
    """
    objective = task.objective
    order: tuple[int, ...] = ()
    while objective.width(order) < task.limit:
        longer = objective.with_best(order, task.limit)
        if longer == order:
            break
        order = longer
    return nested(task, completed(objective, order))


@heuristic("forward-selection-2")
def forward_selection_2(task: Task) -> Found:
    """Add the best parameter, remove the one added in the pass before, and add the best again.

    The first pass only adds. (As [Ros2019] prints Algorithm 3 it lacks the second addition, which
    its text describes.) Subsets are not nested.
    """
    objective = task.objective
    kept = objective.with_best((), task.limit)
    subsets = [kept]
    while objective.width(kept) < task.limit:
        longer = objective.with_best(kept, task.limit)
        if longer == kept:
            break
        renewed = objective.with_best(without(longer, kept[-1]), task.limit)
        # With groups the parameter that comes back may be wider or narrower.
        kept = renewed if objective.width(renewed) > objective.width(kept) else longer
        subsets.append(kept)
    rest = completed(objective, kept)
    subsets += [rest[:k] for k in range(len(kept) + 1, len(rest) + 1)]
    return by_size(objective, [s for s in subsets if s and objective.width(s) <= task.limit])
