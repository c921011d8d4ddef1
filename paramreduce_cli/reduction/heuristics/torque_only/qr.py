"""QR decomposition with column pivoting [Ros2019], Sec. 2.3."""

import numpy as np

from paramreduce_cli.multibody.orthogonal import Orthogonaliser
from paramreduce_cli.reduction.problem import find_first_best
from paramreduce_cli.reduction.task import FoundSubsets, SelectionTask, append_others, make_nested


def qr(task: SelectionTask) -> FoundSubsets:
    """Order columns by how independent they are of the columns before.

    Each step takes the column with the largest residual, or the group with the largest per column. Only W matters, not
    the torques. Dependent columns follow in order of preference.
    """
    objective, problem = task.objective, task.objective.problem
    rest = Orthogonaliser(problem.X[:, problem.columns])
    weights = problem.lengths[problem.columns] ** 2
    order: tuple[int, ...] = ()
    while (left := objective.average_by_group(rest.compute_squared_lengths() * weights)).any():
        group = find_first_best(left)
        for column in np.flatnonzero(objective.owner == group):
            rest.take(int(column))
        order = (*order, group)
    return make_nested(task, append_others(objective, order))
