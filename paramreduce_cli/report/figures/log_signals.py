"""A log before and after it was made ready."""

import numpy as np
from matplotlib.figure import Figure

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.sections import PageSection, placed
from paramreduce_cli.report.style import joint_label, joint_style

_RAW = "#c3c9d0"


@placed(PageSection.LOG, 2)
def log_signals(data: ReportData) -> Figure | None:
    """Speeds and torques as recorded (grey) and as they are used; torques before the low-pass that the model shares."""
    if data.log is None:
        return None
    shown = data.log.shown
    n_dof = shown.dz.shape[1]
    drawn = Figure(figsize=(7.2, 1.15 * n_dof + 0.6))
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
            axes.set_ylabel(f"{label}  {joint_label(data, j)}", fontsize=7)
            axes.tick_params(labelsize=7)
    for axes in grid[-1]:
        axes.set_xlabel("t (s)")
    return drawn
