"""A simulated manoeuvre of the full and of the selected model."""

import numpy as np
from matplotlib.figure import Figure

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.style import choose_joint_style, make_figure
from paramreduce_cli.texts import format_percent

_SHOWN = 4
"""Coordinates that are drawn."""
_ZOOM = 5
"""Accelerations change fast and are drawn for this fraction of the time."""
_DASHES = (0, (3, 2))


@placed(PageSection.MANOEUVRE, 1)
def manoeuvre(data: ReportData) -> Figure | None:
    """Positions and, for a part of the time, accelerations of the coordinates that deviate most, with the full and with
    the selected model.
    """
    result = data.manoeuvre
    if result is None:
        return None
    deviations = result.compute_deviations("position")
    shown = np.argsort(-deviations, kind="stable")[:_SHOWN].tolist()
    drawn = make_figure(0.13 + 0.35 * len(shown))
    grid = drawn.subplots(len(shown), 2, sharex="col", squeeze=False)
    for row, k in zip(grid, shown, strict=True):
        colour, _ = choose_joint_style(k)
        for axes, quantity in zip(row, ("position", "acceleration"), strict=True):
            axes.plot(result.time, result.full[quantity][:, k], color=colour)
            axes.plot(
                result.time, result.selected[quantity][:, k], color="#111", linestyle=_DASHES,
                linewidth=0.9,
            )  # fmt: skip
            deviation = format_percent(float(result.compute_deviations(quantity)[k]))
            axes.set_title(
                f"{result.names[k]}, {quantity}: {deviation} off", fontsize="small", loc="left"
            )
    for axes in grid[-1]:
        axes.set_xlabel("t (s)")
    grid[-1, 1].set_xlim(result.time[0], result.time[-1] / _ZOOM)
    grid[0, 0].plot([], [], color="#7d8590", label="full (in the coordinate's colour)")
    label = f"n = {data.validation.selected.n}"
    grid[0, 0].plot([], [], color="#111", linestyle=_DASHES, label=label)
    drawn.legend(fontsize="small", loc="outside upper center", ncols=2)
    return drawn
