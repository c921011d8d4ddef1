"""Jumps of recorded positions: rows that belong to no motion, and steps after which the motion goes on."""

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # whose ndimage is loaded when it is used

from paramreduce_cli.errors import DataError
from paramreduce_cli.identification.signals import Signals
from paramreduce_cli.records import BoolArray, FloatArray, IntArray

_FASTER = 2.0
"""Factor of the largest speed of a joint from which on a step counts as a jump."""
_SMALL = 0.02
"""Share of a joint's range below which a step is no jump."""
_LONGEST = 0.25
"""Longest duration of a run of bad rows, s."""
_FEW_ROWS = 20
"""Rows that such a run may have at any rate."""
_MOST_BAD = 0.4
"""Share of bad rows beyond which nothing tells the good rows from the bad ones."""
_SPIKE, _WINDOW = 5, 15
"""Samples of the median filters that recorded speeds, and positions, pass before their largest slope is taken."""
_UNBROKEN = 2
"""Edges of a recording without jumps."""
_NAMED = 4
"""Runs of rows that a message names."""


@dataclass(frozen=True)
class PositionJumps:
    """The rows of a recording to cut out, and the rows at which to split it."""

    bad: BoolArray
    """Whether a row belongs to no motion of the robot, (n_rows,)."""
    steps: IntArray
    """Rows with which positions begin anew after a step that stays, (n_steps,)."""


def find_position_jumps(signals: Signals) -> PositionJumps:
    """Find runs of bad rows, and steps after which positions stay changed.

    The recording is followed from its longest stretch without jumps towards both ends. Rows between two stretches that
    the joints can reach from each other are bad. If no stretch within a quarter of a second can be reached, the step is
    kept. A stretch of constant numbers between jumps is bad, and so are rows with the numbers of a bad row.

    Args:
        signals: A recording with all of its rows.

    Raises:
        DataError: Too many rows are bad.
    """
    speed, slack = _find_largest_speeds(signals), _SMALL * _compute_ranges(signals.z)
    bad = np.zeros(signals.time.size, bool)
    edges = [0, *(_find_jumps(signals, speed, slack) + 1).tolist(), signals.time.size]
    if len(edges) == _UNBROKEN:
        return PositionJumps(bad, np.zeros(0, np.int64))
    stretches = []
    for a, b in itertools.pairwise(edges):
        if b - a > 1 and _is_frozen(signals, slice(a, b)):
            bad[a:b] = True
        else:
            stretches.append((a, b))
    if not stretches:
        return PositionJumps(np.zeros_like(bad), np.zeros(0, np.int64))
    longest = max(range(len(stretches)), key=lambda k: stretches[k][1] - stretches[k][0])

    def reachable(first: int, other: int) -> bool:
        """Whether the joints can move from a row to another, later or earlier one."""
        most = slack + _FASTER * speed * abs(signals.time[other] - signals.time[first])
        return bool(np.all(np.abs(signals.z[other] - signals.z[first]) <= most))

    def soon(first: int, other: int) -> bool:
        return (
            abs(other - first) <= _FEW_ROWS
            or abs(signals.time[other] - signals.time[first]) <= _LONGEST
        )

    steps: list[int] = []
    after = [(a, b - 1) for a, b in stretches[longest:]]
    before = [(b - 1, a) for a, b in reversed(stretches[: longest + 1])]
    for stretches_passed in (after, before):
        for last, first, skipped in _follow_stretches(stretches_passed, reachable, soon):
            for a, b in skipped:
                bad[min(a, b) : max(a, b) + 1] = True
            if not reachable(last, first):
                steps.append(max(first, last))
    bad |= _repeat_bad_rows(signals, bad)
    if np.mean(bad) > _MOST_BAD:
        raise DataError(
            f"positions jump in {np.count_nonzero(bad)} of {bad.size} rows, faster than the joints move otherwise. Use a recording of one publisher, or write sampling.log.outliers: keep."
        )
    return PositionJumps(bad, np.array(sorted(steps), dtype=np.int64))


_Stretches = Sequence[tuple[int, int]]
"""First and last row of stretches, in the order in which they are passed."""


def _follow_stretches(
    stretches: _Stretches, reachable: Callable[[int, int], bool], soon: Callable[[int, int], bool]
) -> Iterator[tuple[int, int, _Stretches]]:
    """Yield the row before a cut, the row after it, and the stretches between them."""
    last, k = stretches[0][1], 1
    while k < len(stretches):
        found = k
        while (
            found < len(stretches)
            and soon(last, stretches[found][0])
            and not reachable(last, stretches[found][0])
        ):
            found += 1
        if found == len(stretches) or not reachable(last, stretches[found][0]):
            found = k
        yield last, stretches[found][0], stretches[k:found]
        last, k = stretches[found][1], found + 1


def _find_jumps(signals: Signals, speed: FloatArray, slack: FloatArray) -> IntArray:
    """Return the rows after which a position changes by more than the joint can move, (n_jumps,)."""
    duration = np.diff(signals.time)
    jumps = np.zeros(duration.size, bool)
    for j, column in enumerate(signals.z.T):  # one after the other, as there may be gigabytes
        jumps |= np.abs(np.diff(column)) > slack[j] + _FASTER * speed[j] * duration
    return np.flatnonzero(jumps)


def _is_frozen(signals: Signals, rows: slice) -> bool:
    """Whether all rows hold the same positions and torques."""
    return bool(
        np.all(np.ptp(signals.z[rows], axis=0) == 0)
        and np.all(np.ptp(signals.tau[rows], axis=0) == 0)
    )


def _find_largest_speeds(signals: Signals) -> FloatArray:
    """Return the largest speed that each joint keeps for some samples, (n_dof,): from the positions, or as recorded if
    that is larger.
    """
    speeds = []
    for j in range(signals.z.shape[1]):
        smooth = scipy.ndimage.median_filter(signals.z[:, j], _WINDOW, mode="nearest")
        slopes = [np.gradient(smooth, signals.time)]
        if signals.dz is not None:
            slopes.append(signals.dz[:, j])
        speeds.append(
            max(
                np.abs(scipy.ndimage.median_filter(slope, _SPIKE, mode="nearest")).max()
                for slope in slopes
            )
        )
    return np.array(speeds)


def _compute_ranges(z: FloatArray) -> FloatArray:
    """Return the ranges of positions without single outlying rows, (n_dof,)."""
    smooth = (scipy.ndimage.median_filter(column, _WINDOW, mode="nearest") for column in z.T)
    return np.array([np.ptp(column) for column in smooth])


def _repeat_bad_rows(signals: Signals, bad: BoolArray) -> BoolArray:
    """Whether rows repeat numbers that occur mostly in bad rows."""
    if not bad.any():
        return bad
    parts = [part for part in (signals.z, signals.dz, signals.ddz, signals.tau) if part is not None]
    rows = np.ascontiguousarray(np.column_stack(parts))
    kinds = np.unique(rows.view(f"V{rows.itemsize * rows.shape[1]}").ravel(), return_inverse=True)[
        1
    ]
    size, wrong = np.bincount(kinds), np.bincount(kinds, bad)
    same: BoolArray = ((size > 1) & (2 * wrong >= size))[kinds]
    return same


def name_rows(rows: IntArray, first_line: int | None) -> str:
    """Return runs of rows as text for a message; only the first few are listed.

    Args:
        rows: Numbers of rows from 0, in order, (n_rows,).
        first_line: Line of the first row in its file, None where the file has no lines.
    """
    first = 1 if first_line is None else first_line
    runs = np.split(rows + first, np.flatnonzero(np.diff(rows) > 1) + 1)
    named = [f"{run[0]}" if run.size == 1 else f"{run[0]} to {run[-1]}" for run in runs[:_NAMED]]
    more = f" and {len(runs) - _NAMED} more" if len(runs) > _NAMED else ""
    return f"{'rows' if first_line is None else 'lines'} {', '.join(named)}{more}"
