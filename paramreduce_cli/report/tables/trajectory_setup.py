"""What the trajectories had to be like."""

import numpy as np

from paramreduce_cli.records import FloatArray
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.texts.table import Table


@placed(PageSection.TRAJECTORIES, 2)
def trajectory_setup(data: ReportData) -> Table:
    """Settings and limits of the trajectories."""
    t = data.trajectories
    title, header = "Trajectory setup", ("setting", "value")
    if t is None:
        return Table(title, header, ())
    n_dof, columns = t.estimation[0].coefficients.shape
    limits = t.limits
    rows = [
        ("criterion", f"{t.criterion}, {t.scaling}"),
        ("actuated joints", str(n_dof)),
        ("harmonics", str((columns - 1) // 2)),
        ("trajectory parameters", str(n_dof * columns)),
        ("grid points", str(t.points)),
        ("period, s", f"{t.period:.6g}"),
        (
            "position limits, rad or m",
            _format_limits(np.column_stack([limits.lower, limits.upper])),
        ),
        ("velocity limits, rad/s or m/s", _format_limits(limits.velocity[:, None])),
        ("estimation trajectories", str(len(t.estimation))),
        ("validation trajectories", str(len(t.validation))),
        ("test trajectories", str(len(t.test))),
        ("point-to-point motions of the test set", str(len(t.test_point_to_point))),
        ("every joint uses its range", "yes" if t.use_full_range else "no"),
    ]
    if np.isfinite(limits.acceleration).any():
        rows.append(
            ("acceleration limits, rad/s² or m/s²", _format_limits(limits.acceleration[:, None]))
        )
    for limit, what in (
        (limits.torque, "torque limits, N m or N"),
        (limits.power, "power limits, W"),
    ):
        if np.isfinite(limit).any():
            rows.append((what, _format_limits(limit[:, None])))
    if t.rest_to_rest:
        rows.append(("begin and end at rest, without acceleration", "yes"))
    for c in t.constraints:
        low = "" if np.isinf(c.lower) else f"{c.lower:.4g} ≤ "
        high = "" if np.isinf(c.upper) else f" ≤ {c.upper:.4g}"
        rows.append((f"{c.kind} {c.name}", f"{low}{c.name}{high}"))
    if data.symmetries:
        rows.append(("estimation set completed by symmetries", str(data.symmetries)))
    if t.source:
        rows.append(("coefficients brought in", t.source))
    return Table(title, header, tuple(rows))


def _format_limits(values: FloatArray) -> str:
    """Return the limits of each joint, once where they are the same for all."""
    different = values[:1] if (values == values[0]).all() else values
    return "; ".join(" ".join(f"{value:.4g}" for value in row) for row in different)
