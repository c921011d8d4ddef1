"""Torque error against operations."""

import numpy as np
from matplotlib.figure import Figure

from paramreduce_cli.report.curves import gather_curves
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.style import FUNCTIONS, clip_errors, make_two_plots, place_legend_beside


@placed(PageSection.PAPER, 2, of_mechanism=True)
def error_vs_operations(data: ReportData) -> Figure:
    """Torque error on the estimation set against operations, for the models whose operations were counted.

    Heuristics that found the same models share a curve.
    """
    drawn, *axes = make_two_plots()
    for one, (key, label, _) in zip(axes, FUNCTIONS, strict=True):
        for curve in gather_curves(data):
            values = curve.hide_shared(clip_errors(curve.result.torque_error.estimation))
            one.semilogy(
                curve.result.operations[key], values,
                color=curve.colour, marker=curve.marker, markersize=3, linewidth=0.8, label=curve.label,
            )  # fmt: skip
        front = [
            (float(cost), float(error))
            for r in data.validation.heuristics.values()
            for cost, error in zip(
                r.operations[key], clip_errors(r.torque_error.estimation), strict=True
            )
            if np.isfinite(cost)
        ]
        stairs = np.array(find_staircase(front))
        if stairs.size:
            one.step(*stairs.T, where="post", color="#30363d", linewidth=1.2, label="best known")
        one.set_xlabel(f"operations of {label}")
    axes[0].set_ylabel(r"$\varepsilon_\tau$, estimation")
    place_legend_beside(axes[1])
    return drawn


def find_staircase(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the points (cost, error) that no cheaper point beats, by cost."""
    best, kept = np.inf, []
    for cost, error in sorted(points):
        if error < best:
            best = error
            kept.append((cost, error))
    return kept
