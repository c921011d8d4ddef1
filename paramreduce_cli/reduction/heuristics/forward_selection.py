"""Forward Selection [Ros2019], Algorithm 2."""

from paramreduce_cli.reduction.task import FoundSubsets, SelectionTask, append_others, make_nested


def forward_selection(task: SelectionTask) -> FoundSubsets:
    """Add, one by one, the parameter that lowers the criterion most.

    By torques that is the one that lowers the error most: for a column of which r is left after
    projecting out the subset, the squared error falls by (r . e)^2 / (r . r), e being what is left
    of the torques; for a group it is what its columns explain together, per column. Once nothing
    is left but round-off, the column of which the largest share is left comes next, so that the
    order goes on to a well-conditioned base; dependent columns follow in order of preference.
    """
    objective = task.objective
    order: tuple[int, ...] = ()
    while (longer := objective.add_best(order, task.limit)) != order:
        order = longer
    return make_nested(task, append_others(objective, order))
