"""What leaving out terms saves."""

import numpy as np
from matplotlib.figure import Figure

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.figures.error_vs_operations import find_staircase
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.style import FUNCTIONS, clip_errors, make_two_plots, place_legend_beside


@placed(PageSection.PAPER, 8, of_mechanism=True)
def terms(data: ReportData) -> Figure | None:
    """Torque error against operations: the best models with fewer parameters, and models whose negligible terms are
    pruned. Filled: estimation set; hollow: validation set. Direct dynamics: only models with a positive definite mass
    matrix.
    """
    if data.terms is None:
        return None
    drawn, *axes = make_two_plots()
    for one, (key, label, _) in zip(axes, FUNCTIONS, strict=True):
        found = [
            (float(cost), float(error))
            for result in data.validation.heuristics.values()
            for cost, error, eigenvalue in zip(
                result.operations[key],
                clip_errors(result.torque_error.estimation),
                result.mass_matrix.smallest_eigenvalue,
                strict=True,
            )
            if key == "inverse" or eigenvalue > 0
        ]
        stairs = np.array(find_staircase(found))
        if stairs.size:
            one.step(*stairs.T, where="post", color="#8b949e", label="parameters left out")
        one.set_xlabel(f"operations of {label}")
        term = data.terms.functions.get(key)
        if term is None:
            continue
        front = term.front
        one.semilogy(
            front.operations, clip_errors(front.torque_error.estimation),
            color="#0969da", marker="o", markersize=3, linewidth=1.0, label="pruned terms too",
        )  # fmt: skip
        one.semilogy(
            front.operations, clip_errors(front.torque_error.validation),
            color="#0969da", marker="o", markersize=4, markerfacecolor="none", linestyle="none",
        )  # fmt: skip
        one.axhline(data.terms.torque_budget, color="#cf222e", linewidth=0.8, label="budget")
    axes[0].set_yscale("log")
    axes[0].set_ylabel(r"$\varepsilon_\tau$")
    place_legend_beside(axes[1])
    return drawn
