"""Torques along a trajectory."""

import numpy as np
from matplotlib.figure import Figure

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.sections import PageSection, placed
from paramreduce_cli.report.style import joint_label, joint_style


@placed(PageSection.SELECTED, 2)
def torques(data: ReportData) -> Figure:
    """Torques as they were given or measured, and those of the selected model over the nominal ones, along the validation set."""
    modelled = data.identification is None
    label = ("full" if data.known_model is not None else "given") if modelled else "measured"
    measured = np.flatnonzero(np.isfinite(data.reduction.nominal_torque)).tolist()
    n_dof = len(measured)
    columns = 2 if n_dof > 1 else 1
    rows = -(-n_dof // columns)
    drawn = Figure(figsize=(7.2, 1.55 * rows + 0.5))
    grid = np.atleast_1d(drawn.subplots(rows, columns, sharex=True)).ravel()
    for axes, j in zip(grid, measured, strict=False):
        colour, _ = joint_style(j)
        axes.plot(data.motion.time, data.motion.full[:, j], color=colour, label=label)
        axes.plot(
            data.motion.time, data.motion.reduced[:, j], color="#111", linestyle=(0, (3, 2)),
            linewidth=1.1, label=f"n = {data.validation.selected.n}",
        )  # fmt: skip
        axes.set_ylabel(f"τ / nom, {joint_label(data, j)}", fontsize=8)
        axes.legend(fontsize=7, loc="upper right", ncols=2)
    for spare in grid[n_dof:]:
        spare.set_visible(False)
    for axes in grid[max(0, n_dof - columns) : n_dof]:
        axes.set_xlabel("t (s)" if data.motion.timed else "sample")
    return drawn
