"""Heuristics over what is proven."""

import numpy as np
from matplotlib.figure import Figure

from paramreduce_cli.records import ProofStatus, SelectionMethod
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.sections import PageSection, placed
from paramreduce_cli.report.style import (
    FLOOR,
    WIDE,
    heuristic_style,
    legend_beside,
    mark_selected,
    message,
)


@placed(PageSection.PROOFS, 1)
def proven_bound(data: ReportData) -> Figure:
    """Torque error of every heuristic over what is proven to be possible; no subset is below the grey."""
    proofs = data.reduction.proofs
    if proofs is None:
        return message("best-subset was not run")
    drawn = Figure(figsize=WIDE)
    axes = drawn.subplots()
    shown = np.maximum(proofs.lower_bound, FLOOR)
    axes.fill_between(proofs.n, shown, FLOOR, step="mid", color="#d5d9de", zorder=0)
    axes.step(proofs.n, shown, where="mid", color="#30363d", linewidth=0.9, label="proven bound")
    for name, found in data.reduction.heuristics.items():
        if not SelectionMethod.parse(name).by_torque:
            continue
        colour, marker = heuristic_style(data, name)
        optimal = name == "best-subset"
        axes.semilogy(
            found.n, np.maximum(found.torque_error, FLOOR), color=colour, marker=marker,
            markersize=4 if optimal else 2.5, linewidth=0.8, label=name, linestyle="none" if optimal
            else "-",
        )  # fmt: skip
    axes.set_yscale("log")
    axes.set_ylim(bottom=FLOOR)
    unproven = [status is not ProofStatus.OPTIMAL for status in proofs.status]
    axes.set_title(
        f"optimal for {len(unproven) - sum(unproven)} of {len(unproven)} sizes",
        fontsize=9,
        loc="left",
    )
    mark_selected(axes, data)
    axes.set_xlabel("number of parameters n")
    axes.set_ylabel(r"$\varepsilon_\tau$, estimation")
    legend_beside(axes)
    return drawn
