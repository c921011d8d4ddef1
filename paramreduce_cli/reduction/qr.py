"""QR decomposition with column pivoting [Ros2019], Sec. 2.3."""

from __future__ import annotations

from paramreduce_cli.reduction.problem import first_of_the_best
from paramreduce_cli.reduction.remainder import Remainder
from paramreduce_cli.reduction.task import Found, Task, completed, nested
from paramreduce_cli.registry import heuristic, torque_only


@heuristic("qr")
@torque_only
def qr(task: Task) -> Found:
    """Order columns by how much of them is independent of those before.

    Each step takes the column of which most is left, or the group with the most per column; it
    looks at W alone, not at the torques. Dependent columns follow in order of preference.
    """
    remainder = Remainder(task.objective.problem)
    order: tuple[int, ...] = ()
    while remainder.columns.size:
        lengths = remainder.squared_lengths()
        if not lengths.any():
            break
        unit = int(remainder.units[first_of_the_best(lengths)])
        remainder.take(unit)
        order = (*order, unit)
    return nested(task, completed(task.objective, order))
