"""Torques along a trajectory."""

import numpy as np
from matplotlib.figure import Figure

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.style import choose_joint_style, make_figure

_DASHES = (0, (3, 2))
_ANY = "#7d8590"
"""Stands for the colour of any joint."""


@placed(PageSection.PAPER, 5)
def torques(data: ReportData) -> Figure:
    """Given or measured torques and torques of the selected model, along the validation set."""
    modelled = data.identification is None
    label = ("full" if data.model is not None else "given") if modelled else "measured"
    measured = np.flatnonzero(np.isfinite(data.reduction.nominal_torque)).tolist()
    n_dof = len(measured)
    columns = 2 if n_dof > 1 else 1
    rows = -(-n_dof // columns)
    drawn = make_figure(0.13 + 0.42 * rows)
    grid = np.atleast_1d(drawn.subplots(rows, columns, sharex=True)).ravel()
    for axes, j in zip(grid, measured, strict=False):
        colour, _ = choose_joint_style(j)
        axes.plot(data.motion.time, data.motion.full[:, j], color=colour)
        axes.plot(
            data.motion.time, data.motion.reduced[:, j], color="#111", linestyle=_DASHES,
            linewidth=1.1,
        )  # fmt: skip
        unit = f" ({data.find_force_unit(j)})" if data.find_force_unit(j) else ""
        axes.set_ylabel(f"τ{unit}, {data.name_joint(j)}", fontsize="small")
    for spare in grid[n_dof:]:
        spare.set_visible(False)
    for axes in grid[max(0, n_dof - columns) : n_dof]:
        axes.set_xlabel("t (s)" if data.motion.timed else "sample")
    grid[0].plot([], [], color=_ANY, label=f"{label} (in the joint's colour)")
    grid[0].plot([], [], color="#111", linestyle=_DASHES, label=f"n = {data.validation.selected.n}")
    drawn.legend(fontsize="small", loc="outside upper center", ncols=2)
    return drawn
