"""Whole turns by which recorded angles jump where a sensor wraps around."""

import numpy as np

from paramreduce_cli.records import FloatArray, IntArray

_OFF_A_TURN = 0.3
"""Distance from a whole turn up to which a step counts as one, rad."""
_BESIDE = 4
"""Steps before and after a large one that say how fast the joint moves."""


def unwrap_positions(z: FloatArray) -> tuple[int, ...]:
    """Make positions continuous in place by adding whole revolutions where they jump.

    A step counts as a revolution if the positions before and after it continue each other without it.

    Args:
        z: Positions, rad, (n_rows, n_dof).

    Returns:
        Number of such jumps by column, (n_dof,).
    """
    counts = [0] * z.shape[1]
    revolution = 2 * np.pi
    for j, column in enumerate(z.T):
        steps = np.diff(column)
        large = np.flatnonzero(np.abs(steps) > np.pi)
        if not large.size:
            continue
        usual = _find_usual_steps(steps, large)
        turns = np.round((usual - steps[large]) / revolution)
        whole = np.abs(steps[large] + turns * revolution - usual) < _OFF_A_TURN
        turns[~whole] = 0
        added = np.zeros(column.size)
        added[large + 1] = turns * revolution
        column += np.cumsum(added)
        counts[j] = int(np.count_nonzero(turns))
    return tuple(counts)


def _find_usual_steps(steps: FloatArray, large: IntArray) -> FloatArray:
    """Return the median of the small steps around large ones, (n_large,); zero if there are none."""
    small = np.abs(steps) <= np.pi
    found = np.zeros(large.size)
    for k, place in enumerate(large.tolist()):
        around = slice(max(0, place - _BESIDE), place + _BESIDE + 1)
        beside = steps[around][small[around]]
        found[k] = np.median(beside) if beside.size else 0.0
    return found
