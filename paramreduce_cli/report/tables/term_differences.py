"""How far torques of functions with pruned terms stray."""

import numpy as np

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.style import FUNCTIONS
from paramreduce_cli.texts import format_percent
from paramreduce_cli.texts.table import Table


@placed(PageSection.TERMS, 3)
def term_differences(data: ReportData) -> Table:
    """Largest difference of each joint's torque, N m (N), and relative to its nominal torque, on random states inside
    the limits (on both sets where there are none). The state is that of the worst joint, marked with a star, in units
    of the table above.
    """
    functions = data.terms.functions if data.terms is not None else {}
    labels = {key: label for key, label, _ in FUNCTIONS}
    header = ("function", "joint", "largest", "of nominal", "position", "velocity", "acceleration")
    rows = []
    for name, one in functions.items():
        for j, joint in enumerate(data.robot_model.mechanism.coordinate_names):
            largest, nominal = one.largest_difference[j], data.reduction.nominal_torque[j]
            star = " *" if j == one.worst_joint else ""
            sizes = (
                (f"{largest:.3g}", format_percent(largest / nominal))
                if not np.isnan(largest)
                else ("-", "-")
            )
            state = (f"{value:.4g}" for value in one.worst_state[:, j])
            rows.append((labels[name], f"{joint}{star}", *sizes, *state))
    return Table("Differences of torques with pruned terms", header, tuple(rows))
