"""How every trajectory of all sets excites the parameters, and what it took to find."""

import numpy as np

from paramreduce_cli.records import SETS, Trajectory
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.texts.table import Table


@placed(PageSection.TRAJECTORIES, 3, tall=True)
def trajectories(data: ReportData) -> Table:
    """Condition numbers and peak values of every trajectory."""
    found = data.trajectories
    if found is None:
        return Table("Trajectories: recorded states were used", ("set",), ())
    variants = tuple(found.estimation[0].kappa_variants)
    header = (
        "trajectory", *(f"κ {name}" for name in variants), "κ at start",
        "peak |z - middle|", "peak speed", "peak torque", "share of limits",
        *(f"{c.name}" for c in found.constraints), "CPU s", "iterations", "status",
    )  # fmt: skip
    rows = [
        _list_cells(f"{name} {k + 1}", t)
        for name in SETS
        for k, t in enumerate(getattr(found, name))
    ]
    return Table("Trajectories", header, tuple(rows))


def _list_cells(label: str, t: Trajectory) -> tuple[str, ...]:
    """Return the cells of one trajectory."""

    def spread(values: np.ndarray) -> str:
        return " ".join(f"{value:.3g}" for value in values)

    return (
        label,
        *(f"{value:.4g}" for value in t.kappa_variants.values()),
        f"{t.kappa_start:.3g}",
        spread(t.peak_position),
        spread(t.peak_velocity),
        spread(t.peak_torque),
        spread(t.reach),
        *(f"{low:.3g} ... {high:.3g}" for low, high in t.extremes),
        f"{t.cpu_seconds:.2f}",
        str(t.iterations),
        t.status.replace("_", " "),
    )
