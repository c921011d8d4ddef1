"""Forward Selection [Ros2019], Algorithm 2."""

from __future__ import annotations

import numpy as np

from paramreduce_cli.records import IntArray
from paramreduce_cli.reduction.problem import (
    FULL_PRECISION,
    SelectionProblem,
    first_of_the_best,
)
from paramreduce_cli.reduction.remainder import Remainder
from paramreduce_cli.registry import heuristic


@heuristic("forward-selection")
def forward_selection(problem: SelectionProblem) -> IntArray:
    """Add, one by one, the parameter that lowers the torque error most.

    For a column x of which r is left after projecting out the subset, adding it lowers the
    squared error by (r . e)^2 / (r . r), e being what is left of the torques; for a group it is
    what its columns explain together, per column. Once nothing is
    left but round-off, the column of which the largest share is left comes next, so that the
    order goes on to a well-conditioned base; dependent columns follow in order of preference.

    Returns:
        All candidates, (n_candidates,).
    """
    remainder = Remainder(problem)
    while remainder.columns.size:
        lengths = remainder.squared_lengths()
        if not lengths.any():
            break
        if np.linalg.norm(remainder.chi) > FULL_PRECISION * remainder.chi_length:
            scores = remainder.gains()
        else:
            scores = remainder.relative_squared_lengths()
        remainder.take(first_of_the_best(scores))
    return remainder.take_the_rest()
