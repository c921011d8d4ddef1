"""Values of the reduced model with how sure they are."""

import numpy as np
from matplotlib.figure import Figure

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.style import make_figure


@placed(PageSection.IDENTIFICATION, 4)
def identified_parameters(data: ReportData) -> Figure | None:
    """Identified parameters of the reduced model, relative to their own size, with 95 % confidence intervals for noise
    as coloured as the residuals.
    """
    if data.identification is None:
        return None
    found = data.identification.reduced
    relative = found.half_widths / np.maximum(np.abs(found.values), 1e-300)
    order = np.argsort(relative)
    drawn = make_figure(0.8)
    axes = drawn.subplots()
    positions = np.arange(order.size)
    axes.errorbar(
        positions, np.ones(order.size), np.minimum(relative[order], 10), fmt="o", color="#0b62c4",
        markersize=4, capsize=3, linewidth=1.1,
    )  # fmt: skip
    axes.axhline(0, color="#8a929c", linewidth=0.8)
    widest = min(3.0, float(relative.max(initial=0.1)) * 1.15)
    axes.set_ylim(1 - max(widest, 0.2), 1 + max(widest, 0.2))
    axes.set_xticks(positions, [found.names[k] for k in order], rotation=90, fontsize="x-small")
    axes.set_ylabel("value / own value")
    return drawn
