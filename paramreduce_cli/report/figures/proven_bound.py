"""Heuristics over what is proven."""

import numpy as np
from matplotlib.figure import Figure

from paramreduce_cli.records import SelectionMethod
from paramreduce_cli.report.curves import gather_curves
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.style import (
    FLOOR,
    LEAST_MEASURED,
    draw_message,
    make_figure,
    mark_selected,
    place_legend_beside,
)


@placed(PageSection.PROOFS, 1)
def proven_bound(data: ReportData) -> Figure:
    """Torque error of every heuristic and the proven lower bound; no subset lies in the grey area."""
    proofs = data.reduction.proofs
    if proofs is None:
        return draw_message("best-subset was not run")
    drawn = make_figure()
    axes = drawn.subplots()
    # Measured torques are never explained to round-off; small sizes are bounded by nothing at times.
    floor = FLOOR if data.identification is None else LEAST_MEASURED
    shown = np.maximum(proofs.lower_bound, floor)
    axes.fill_between(proofs.n, shown, floor, step="mid", color="#d5d9de", zorder=0)
    axes.step(proofs.n, shown, where="mid", color="#30363d", linewidth=0.9, label="proven bound")
    for curve in gather_curves(data):
        names = [name for name in curve.names if SelectionMethod.parse(name).by_torque]
        proven = "best-subset" in names
        if not names:
            continue
        found = data.reduction.heuristics[names[0]]
        axes.semilogy(
            found.n, np.maximum(found.torque_error, FLOOR), color=curve.colour, marker=curve.marker,
            markersize=4 if proven else 2.5, linewidth=0.8, label=", ".join(names),
            linestyle="none" if proven and len(names) == 1 else "-",
        )  # fmt: skip
    axes.set_yscale("log")
    axes.set_ylim(bottom=floor)
    axes.set_title(
        f"optimal for {proofs.n_proven} of {proofs.n_provable} sizes up to the rank",
        fontsize="medium",
        loc="left",
    )
    mark_selected(axes, data)
    axes.set_xlabel("number of parameters n")
    axes.set_ylabel(r"$\varepsilon_\tau$, estimation")
    place_legend_beside(axes)
    return drawn
