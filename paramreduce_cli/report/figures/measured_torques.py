"""Measured torques of the held-out part beside those of two models."""

import numpy as np
from matplotlib.figure import Figure

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.style import choose_joint_style, make_figure, place_legend_above


@placed(PageSection.PAPER, 7)
def measured_torques(data: ReportData) -> Figure | None:
    """Held-out data: measured torques and torques of the reduced model (left), residuals of both models (right), N m
    (N).
    """
    found = data.identification
    if found is None:
        return None
    joints = np.flatnonzero(np.isfinite(found.torque_deviation)).tolist()
    drawn = make_figure(0.16 + 0.33 * len(joints))
    grid = drawn.subplots(len(joints), 2, sharex=True, squeeze=False)
    n, m = len(found.reduced.names), len(found.full.names)
    for (left, right), j in zip(grid, joints, strict=True):
        colour, _ = choose_joint_style(j)
        measured = found.shown_measured[:, j]
        left.plot(found.shown_time, measured, color=colour, linewidth=1.0, label="measured")
        left.plot(found.shown_time, found.shown_reduced[:, j], color="#111", linewidth=0.9,
                  linestyle=(0, (3, 2)), label=f"n = {n}")  # fmt: skip
        for values, line_colour, label in (
            (found.shown_full, "#b9c2cc", f"all {m}"),
            (found.shown_reduced, "#111", f"n = {n}"),
        ):
            right.plot(found.shown_time, measured - values[:, j], color=line_colour, linewidth=0.8,
                       label=label)  # fmt: skip
        left.set_ylabel(f"τ  {data.name_joint(j)}", fontsize="x-small")
        for axes in (left, right):
            axes.tick_params(labelsize="x-small")
    for axes in grid[0]:
        place_legend_above(axes, 2)
    for axes in grid[-1]:
        axes.set_xlabel("t (s)")
    return drawn
