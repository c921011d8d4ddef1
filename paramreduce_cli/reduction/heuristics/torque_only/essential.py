"""Essential parameters [Pham1991]."""

import numpy as np

from paramreduce_cli.multibody.orthogonal import select_independent
from paramreduce_cli.records import FloatArray
from paramreduce_cli.reduction.objective import Objective, Subset, remove_group
from paramreduce_cli.reduction.task import FoundSubsets, SelectionTask, append_others, make_nested


def essential(task: SelectionTask) -> FoundSubsets:
    """Remove, one by one, the parameter with the largest standard deviation relative to its value.

    The search starts from the preferred base set. After each removal the other parameters are fitted again. A group has
    the certainty of its most certain member.
    """
    objective = task.objective
    everything = tuple(range(len(objective.groups)))
    columns = select_independent(objective.problem.W, objective.list_columns(everything))
    left: Subset = tuple(sorted(objective.find_groups(np.array(columns))))
    tail = append_others(objective, left)[len(left) :]
    while left:
        unsure = _compute_relative_deviations(objective, left)
        removed = left[len(left) - 1 - int(np.argmax(unsure[::-1]))]  # ties: the least preferred
        left, tail = remove_group(left, removed), (removed, *tail)
    return make_nested(task, tail)


def _compute_relative_deviations(objective: Objective, kept: Subset) -> FloatArray:
    """Return the standard deviation over the value of each group, up to a common factor, (n_kept,)."""
    problem = objective.problem
    columns = objective.list_columns(kept)
    X = problem.X[:, columns]
    u, s, vt = np.linalg.svd(X, full_matrices=False)
    s = np.maximum(s, 1e-12 * s[0])
    values = vt.T @ ((u.T @ problem.chi) / s)
    deviations = np.linalg.norm(vt.T / s, axis=1)
    with np.errstate(divide="ignore"):
        relative = np.where(values != 0, deviations / np.abs(values), np.inf)
    ends = np.cumsum([objective.groups[group].size for group in kept])[:-1]
    return np.array([part.min() for part in np.split(relative, ends)])
