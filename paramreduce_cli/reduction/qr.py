"""QR decomposition with column pivoting [Ros2019], Sec. 2.3."""

from __future__ import annotations

from paramreduce_cli.records import IntArray
from paramreduce_cli.reduction.problem import SelectionProblem, first_of_the_best
from paramreduce_cli.reduction.remainder import Remainder
from paramreduce_cli.registry import heuristic


@heuristic("qr")
def qr(problem: SelectionProblem) -> IntArray:
    """Order columns by how much of them is independent of those before.

    Each step takes the column of which most is left, or the group with the most per column; it looks at W alone, not at the torques.
    Dependent columns follow in order of preference.

    Returns:
        All candidates, (n_candidates,).
    """
    remainder = Remainder(problem)
    while remainder.columns.size:
        lengths = remainder.squared_lengths()
        if not lengths.any():
            break
        remainder.take(first_of_the_best(lengths))
    return remainder.take_the_rest()
