"""Health of the mass matrix."""

import numpy as np
from matplotlib.figure import Figure

from paramreduce_cli.report.curves import gather_curves
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.style import (
    clip_errors,
    make_figure,
    mark_selected,
    place_legend_beside,
)


@placed(PageSection.ACCELERATIONS, 2)
def mass_matrix_condition(data: ReportData) -> Figure:
    """Largest condition number of the mass matrix over the samples; hollow markers: the matrix is indefinite.

    Heuristics that found the same models share a curve.
    """
    drawn = make_figure()
    axes = drawn.subplots()
    for curve in gather_curves(data):
        result, colour = curve.result, curve.colour
        condition = curve.hide_shared(clip_errors(result.mass_matrix.condition))
        positive = result.mass_matrix.smallest_eigenvalue > 0
        axes.semilogy(result.n, condition, color=colour, linewidth=0.8, label=curve.label)
        for chosen, fill in ((positive, colour), (~positive, "white")):
            axes.semilogy(
                result.n[chosen], condition[chosen], linestyle="none", marker=curve.marker,
                markersize=4, markerfacecolor=fill, color=colour,
            )  # fmt: skip
    full = data.validation.full["mass_matrix_condition"]
    if np.isfinite(full):  # not where a last link has no inertia
        axes.axhline(full, color="#57606a", linewidth=0.8, linestyle=":")
        name = "full model" if data.identification is None else "values of the config"
        axes.annotate(name, (1.0, full), xycoords=("axes fraction", "data"), ha="right",
                      va="bottom", fontsize="small", color="#57606a")  # fmt: skip
        axes.set_ylim(top=min(axes.get_ylim()[1], full * 1e6))
    mark_selected(axes, data)
    axes.set_xlabel("number of parameters n")
    axes.set_ylabel("largest κ(M) over the samples")
    place_legend_beside(axes)
    return drawn
