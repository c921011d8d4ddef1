"""Forward Selection [Ros2019], Algorithm 2."""

from paramreduce_cli.reduction.task import FoundSubsets, SelectionTask, append_others, make_nested


def forward_selection(task: SelectionTask) -> FoundSubsets:
    """Add, one by one, the parameter that lowers the criterion most.

    For torques this is the parameter that lowers the error most. With r the residual of a column and e that of the
    torques after projection on the subset, the squared error falls by (r . e)^2 / (r . r); a group counts with the fall
    by all its columns, per column. If only round-off is left, the most independent column comes next, which leads to a
    well-conditioned base; dependent columns follow in order of preference.
    """
    objective = task.objective
    order: tuple[int, ...] = ()
    while (longer := objective.add_best(order, task.limit)) != order:
        order = longer
    return make_nested(task, append_others(objective, order))
