"""Columns of a log without headings, recognised by their order and their numbers."""

from collections.abc import Mapping

import numpy as np

from paramreduce_cli.records import FloatArray

_SLOPE = 0.9
"""Correlation from which on a column is the derivative of another one."""
_LEAST = 10
"""Rows."""


def guess_order(columns: Mapping[str, FloatArray], n: int) -> dict[str, str | list[str]]:
    """Return the columns of time, positions, speeds, accelerations and torques by their order, as far as recognised.

    Time increases from row to row, and stands first. Positions of all joints follow, then their derivatives if these
    were recorded, and torques last.

    Args:
        columns: Columns by name, in their order.
        n: Number of joints.
    """
    names = list(columns)
    found: dict[str, str | list[str]] = {}
    if not names or columns[names[0]].size < _LEAST:
        return found
    if np.all(np.diff(columns[names[0]]) > 0):
        found["time"] = names.pop(0)
    if not names or len(names) % n:
        return found
    blocks = [names[k : k + n] for k in range(0, len(names), n)]
    if len(blocks) < 2:
        return found
    found["position"] = blocks[0]
    k = 1
    for key in ("velocity", "acceleration"):
        if k + 1 < len(blocks) and _is_derivative(columns, blocks[k - 1], blocks[k]):
            found[key] = blocks[k]
            k += 1
    if k + 1 == len(blocks):
        found["torque"] = blocks[k]
    return found


def _is_derivative(columns: Mapping[str, FloatArray], block: list[str], other: list[str]) -> bool:
    """Return whether columns follow the slopes of others; the median of the correlations decides."""
    alike = []
    for name, slope in zip(block, other, strict=True):
        own = np.gradient(columns[name])
        if np.ptp(own) > 0 and np.ptp(columns[slope]) > 0:
            alike.append(float(np.corrcoef(own, columns[slope])[0, 1]))
    return bool(alike) and float(np.median(alike)) > _SLOPE
