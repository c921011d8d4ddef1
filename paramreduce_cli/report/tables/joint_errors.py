"""Errors of the selected model, joint by joint."""

import numpy as np

from paramreduce_cli.report.data import NO_TORQUE, ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.texts import format_percent
from paramreduce_cli.texts.table import Table


@placed(PageSection.PAPER, 6)
def joint_errors(data: ReportData) -> Table:
    """Torque error of the selected model for each joint: root mean square, and relative to that joint's torque."""
    selected = data.validation.selected
    result = data.validation.heuristics[selected.heuristic]
    row = result.find_row(selected.n)
    rows = []
    for j in np.flatnonzero(np.isfinite(data.reduction.nominal_torque)).tolist():
        cells = [data.name_joint(j)]
        for which, rms in data.rms_torque.items():
            relative = float(result.joint_torque_error[which][row][j])
            unit = data.find_force_unit(j)
            cells.append(f"{relative * rms[j]:.2g} {unit}" if unit else "")
            cells.append(format_percent(relative) if rms[j] > NO_TORQUE else "no torque")
        rows.append(tuple(cells))
    header = ("joint", *(f"{which}{end}" for which in data.rms_torque for end in ("", ", share")))
    return Table("Errors joint by joint", header, tuple(rows))
