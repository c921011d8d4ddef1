"""Sequential floating forward selection [Pudil1994]."""

from paramreduce_cli.reduction.objective import Subset
from paramreduce_cli.reduction.problem import TIE
from paramreduce_cli.reduction.task import FoundSubsets, SelectionTask, append_others, sort_by_size


def floating(task: SelectionTask) -> FoundSubsets:
    """Add the best parameter, then remove parameters as long as that gives the best subset of its size so far.

    After every addition the parameter whose removal costs least is removed if the smaller subset is better than the
    best one of its size so far; this is repeated until it is not.
    """
    objective = task.objective
    best: dict[int, tuple[float, Subset]] = {}
    kept: Subset = ()
    while (longer := objective.add_best(kept, task.limit)) != kept:
        kept = longer
        _keep_if_better(task, best, kept)
        while len(kept) > 2:
            shorter = objective.remove_worst(kept)
            if not _keep_if_better(task, best, shorter):
                break
            kept = shorter
        kept = best[objective.count_columns(kept)][1]
    rest = append_others(objective, kept)
    for k in range(len(kept) + 1, len(rest) + 1):
        if objective.count_columns(rest[:k]) <= task.limit:
            best[objective.count_columns(rest[:k])] = (0.0, rest[:k])
    return sort_by_size(objective, [groups for n, (_, groups) in best.items() if n <= task.limit])


def _keep_if_better(
    task: SelectionTask, best: dict[int, tuple[float, Subset]], kept: Subset
) -> bool:
    """Store a subset if it is better than the best of its size so far, and return whether it is."""
    n, score = task.objective.count_columns(kept), task.objective.score(kept)
    if n in best and not score < best[n][0] * (1 - TIE):
        return False
    best[n] = (score, kept)
    return True
