"""A log before and after it was made ready."""

import numpy as np
from matplotlib.figure import Figure

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.sections import PageSection, placed
from paramreduce_cli.report.style import joint_style, new_figure

_RAW = "#c3c9d0"


@placed(PageSection.LOG, 2)
def log_signals(data: ReportData) -> Figure | None:
    """Speeds and torques as recorded (grey) and as they are used; torques before the low-pass that the model shares."""
    if data.log is None:
        return None
    shown = data.log.shown
    n_dof = shown.dz.shape[1]
    drawn = new_figure(0.16 + 0.33 * n_dof)
    grid = drawn.subplots(n_dof, 2, sharex=True, squeeze=False)
    for j in range(n_dof):
        colour, _ = joint_style(j)
        for axes, raw, used, label in (
            (grid[j, 0], shown.raw_dz, shown.dz, "ż"),
            (grid[j, 1], shown.raw_tau, shown.tau, "τ"),
        ):
            axes.plot(shown.raw_time, raw[:, j], color=_RAW, linewidth=0.8)
            axes.plot(shown.time, used[:, j], color=colour, linewidth=1.0)
            size = float(np.abs(used[:, j]).max()) or 1.0
            axes.set_ylim(-1.3 * size, 1.3 * size)
            axes.set_ylabel(f"{label}  {data.joint_label(j)}", fontsize="x-small")
            axes.tick_params(labelsize="x-small")
    for axes in grid[-1]:
        axes.set_xlabel("t (s)")
    return drawn
