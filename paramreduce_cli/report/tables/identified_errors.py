"""Errors of measured torques, joint by joint."""

import math

import numpy as np

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.texts import format_percent
from paramreduce_cli.texts.table import Table


@placed(PageSection.IDENTIFICATION, 3)
def identified_errors(data: ReportData) -> Table:
    """Held-out errors of each joint: root mean square in N m (N), relative to the torques, and relative to the nominal
    torque (which may be the limit). Also: correlation of a residual with the previous one, probability of such
    residuals if they were white (Ljung-Box), and the equivalent number of white samples.
    """
    found = data.identification
    header = (
        "joint", "noise", "all, N m", "reduced, N m", "of torques", "of nominal", "lag-1", "white, p", "eff. samples",
    )  # fmt: skip
    rows = []
    if found is not None:
        nominal = data.robot_model.nominal_torque if data.robot_model.nominal_torque_given else None
        for j, name in enumerate(data.robot_model.mechanism.coordinate_names):
            if not math.isfinite(found.torque_deviation[j]):
                continue
            error = float(found.reduced.joint_held_out[j])
            rows.append(
                (
                    name,
                    "-" if data.log is None else f"{data.log.noise[j]:.3g}",
                    f"{found.full.joint_held_out[j]:.3g}",
                    f"{error:.3g}",
                    format_percent(error / float(found.torque_size[j])),
                    "-" if nominal is None else format_percent(error / float(nominal[j])),
                    f"{found.residuals.lag_one[j]:.2f}",
                    f"{found.residuals.white[j]:.2g}",
                    f"{found.residuals.effective_samples[j]:.0f}",
                )
            )
        worst = f"{np.nanmax(found.reduced.joint_held_out):.3g}"
        rows.append(
            ("all", "", format_percent(found.full.held_out), format_percent(found.reduced.held_out), f"worst {worst}",
             "", "", "", "")
        )  # fmt: skip
    return Table("Errors on measured torques", header, tuple(rows))
