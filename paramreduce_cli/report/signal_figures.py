"""Signals of a log in figures, joint by joint."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paramreduce_cli.records import FloatArray, ShownSignals
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.style import choose_joint_style, make_figure

_RAW = "#b4bac2"
_HELD_OUT = "#d8e6f5"
_CUT = "#eceef0"
_ROOM = 0.15
"""Share of a signal's range that is left free above and below."""

Column = tuple[str, FloatArray | None, FloatArray, int | None]
"""Symbol and units, as recorded if it was, as it is used, and the number of its outliers' signal if it can have any."""


def draw_signals(data: ReportData, shown: ShownSignals, columns: Sequence[Column]) -> Figure:
    """Return a figure with a row for each joint and a column for each signal."""
    n_dof = shown.z.shape[1]
    drawn = make_figure(0.2 + 0.3 * n_dof)
    grid = drawn.subplots(n_dof, len(columns), sharex=True, squeeze=False)
    for j in range(n_dof):
        colour, _ = choose_joint_style(j)
        for axes, (_, raw, used, outlying) in zip(grid[j], columns, strict=True):
            _shade(axes, shown)
            if raw is not None:
                axes.plot(shown.raw_time, raw[:, j], color=_RAW, linewidth=1.2)
            axes.plot(shown.time, used[:, j], color=colour, linewidth=0.9)
            low, high = float(used[:, j].min()), float(used[:, j].max())
            room = _ROOM * (high - low) or 1.0
            axes.set_ylim(low - room, high + room)
            replaced = (shown.outliers[:, 0] == outlying) & (shown.outliers[:, 1] == j)
            times = shown.outliers[replaced, 2]
            axes.plot(
                times, np.full(times.size, high + room / 2), "|", color="#c2384f", markersize=4
            )
            axes.tick_params(labelsize="x-small")
        grid[j, 0].set_ylabel(data.name_joint(j), fontsize="x-small")
    for axes, (title, *_) in zip(grid[0], columns, strict=True):
        axes.set_title(title, fontsize="small")
    for axes in grid[-1]:
        axes.set_xlabel("t (s)")
    grid[0, 0].set_xlim(shown.raw_time[0], shown.raw_time[-1])
    return drawn


def _shade(axes: Axes, shown: ShownSignals) -> None:
    """Shade the held-out part, and the ends that are cut off."""
    bounds = np.concatenate([shown.learned, shown.held_out])
    bounds = bounds[np.isfinite(bounds)]
    ends = (
        [(shown.raw_time[0], bounds.min()), (bounds.max(), shown.raw_time[-1])]
        if bounds.size
        else []
    )
    for first, last in ends:
        if last > first:
            axes.axvspan(first, last, color=_CUT, linewidth=0, zorder=0)
    if np.isfinite(shown.held_out).all():
        axes.axvspan(*shown.held_out, color=_HELD_OUT, linewidth=0, zorder=0)
