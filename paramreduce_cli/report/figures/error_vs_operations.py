"""Torque error against operations."""

import numpy as np
from matplotlib.figure import Figure

from paramreduce_cli.report.curves import curves
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.sections import PageSection, placed
from paramreduce_cli.report.style import FUNCTIONS, legend_beside, pair_of_plots, visible


@placed(PageSection.SAVINGS, 3)
def error_vs_operations(data: ReportData) -> Figure:
    """Torque error on the estimation set against the operations it costs, of the models that were counted. What several heuristics found is drawn once, for the first of them."""
    drawn, *axes = pair_of_plots()
    for one, (key, label, _) in zip(axes, FUNCTIONS, strict=True):
        for curve in curves(data):
            values = curve.drawn(visible(curve.result.torque_error.estimation))
            one.semilogy(
                curve.result.operations[key], values,
                color=curve.colour, marker=curve.marker, markersize=3, linewidth=0.8, label=curve.label,
            )  # fmt: skip
        front = [
            (float(cost), float(error))
            for r in data.validation.heuristics.values()
            for cost, error in zip(
                r.operations[key], visible(r.torque_error.estimation), strict=True
            )
            if np.isfinite(cost)
        ]
        stairs = np.array(staircase(front))
        if stairs.size:
            one.step(*stairs.T, where="post", color="#30363d", linewidth=1.2, label="best known")
        one.set_xlabel(f"operations of {label}")
    axes[0].set_ylabel(r"$\varepsilon_\tau$, estimation")
    legend_beside(axes[1])
    return drawn


def staircase(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Of points (cost, error) those that no cheaper one beats, by cost."""
    best, kept = np.inf, []
    for cost, error in sorted(points):
        if error < best:
            best = error
            kept.append((cost, error))
    return kept
