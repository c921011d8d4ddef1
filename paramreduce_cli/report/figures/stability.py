"""The selection on other data."""

import numpy as np
from matplotlib.figure import Figure

from paramreduce_cli.records import DataChange
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.style import draw_message, make_figure, place_legend_above

_WIDE_SPREAD = 100.0
"""Per cent of change from which on a logarithmic scale shows more."""


@placed(PageSection.STABILITY, 1)
def stability(data: ReportData) -> Figure:
    """Results on other data: how often each parameter is selected, the spread of its value, and the torque error."""
    found, names = data.validation.stability, data.reduction.columns.names
    if found is None:
        return draw_message("validation.stability is off")
    drawn = make_figure(1.3)
    often = found.chosen.mean(axis=0)
    order = np.argsort(-often, kind="stable")[: int(np.sum(often > 0))]
    upper, middle, lower = drawn.subplots(3, 1)
    positions = np.arange(order.size)
    own = np.isin(order, np.flatnonzero(found.chosen[0]))
    upper.bar(positions, 100 * often[order], color=np.where(own, "#0b62c4", "#b9c2cc"), width=0.7)
    upper.set_ylabel("chosen, %")
    for place, column in zip(positions, order, strict=True):
        values = found.values[found.chosen[:, column], column]
        scale = np.abs(np.median(values)) or 1.0
        middle.plot([place, place], 100 * (np.array([values.min(), values.max()]) / scale
                    - np.sign(np.median(values))), color="#0b62c4", linewidth=3)  # fmt: skip
    if np.abs(middle.get_ylim()).max() > _WIDE_SPREAD:
        middle.set_yscale("symlog", linthresh=10)
    middle.set_ylabel("φ' - median, %")
    for axes, shown in ((upper, False), (middle, True)):
        labels = [names[k] for k in order] if shown else []
        axes.set_xticks(
            positions, labels if shown else [""] * order.size, rotation=90, fontsize="x-small"
        )
        axes.set_xlim(-0.7, order.size - 0.3)
        axes.grid(axis="x", visible=False)
    thinned = np.array([v.change is DataChange.THINNED for v in found.variants])
    numbers = np.arange(len(found.variants))
    for chosen, colour, label in (
        (~thinned, "#0b62c4", "all, then one trajectory left out"),
        (
            thinned,
            "#d9730d",
            ", ".join(str(v) for v in found.variants if v.change is DataChange.THINNED),
        ),
    ):
        if chosen.any():
            lower.plot(
                numbers[chosen], 100 * found.torque_error[chosen], "o", color=colour, markersize=4,
                label=label,
            )  # fmt: skip
    lower.set_xticks(numbers, ["all", *map(str, numbers[1:])], fontsize="x-small")
    lower.set_xlabel("which trajectory is left out; then fewer samples")
    lower.set_ylabel(r"$\varepsilon_\tau$, %")
    place_legend_above(lower, 2)
    return drawn
