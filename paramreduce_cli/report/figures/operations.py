"""Operations against n."""

from matplotlib.figure import Figure

from paramreduce_cli.report.curves import gather_curves
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.style import FUNCTIONS, make_figure, mark_selected, place_legend_beside


@placed(PageSection.PAPER, 3, of_mechanism=True)
def operations(data: ReportData) -> Figure:
    """Operations of the lean inverse and direct dynamics against the number of parameters; thin lines: all parameters.

    Heuristics that found the same models share a curve. Of large robots only some models are counted.
    """
    drawn = make_figure()
    axes = drawn.subplots()
    for curve in gather_curves(data):
        for key, _, line in FUNCTIONS:
            values = curve.hide_shared(curve.result.operations[key])
            axes.plot(
                curve.result.n, values, line, color=curve.colour, marker=curve.marker, markersize=2.5,
                label=curve.label if line == "-" else None,
            )  # fmt: skip
    for key, _, line in FUNCTIONS:
        axes.axhline(
            data.validation.full[f"operations_{key}"],
            color="#57606a", linewidth=0.8, linestyle=":" if line == "-" else "-.",
        )  # fmt: skip
    mark_selected(axes, data)
    axes.set_ylim(bottom=0)
    axes.set_xlabel("number of parameters n")
    axes.set_ylabel("operations")
    for _, label, line in FUNCTIONS:
        axes.plot([], [], line, color="#57606a", label=label)
    place_legend_beside(axes)
    return drawn
