"""How many parameters the data can tell."""

from matplotlib.figure import Figure

from paramreduce_cli.identification.quality import estimate_noise_floor
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.style import make_figure, mark_selected, place_legend_beside

_OVER_BEST = 4.0
"""Largest error shown, times the smallest."""


@placed(PageSection.IDENTIFICATION, 1)
def cross_validation(data: ReportData) -> Figure | None:
    """Torque error against the number of parameters: on the training data, in cross-validation (with one standard
    error) and held out. Dotted: all parameters, with parts left out. Dashed: the error that noise alone would leave.
    """
    crossed = data.validation.cross_validation
    if crossed is None:
        return None
    name = data.validation.selected.heuristic
    result, own = data.validation.heuristics[name], crossed[name]
    drawn = make_figure()
    axes = drawn.subplots()
    axes.plot(result.n, 100 * result.torque_error.estimation, color="#7d8590", label="learned from")
    axes.errorbar(
        own.n, 100 * own.mean, 100 * own.standard_error, color="#0b62c4", capsize=2, linewidth=1.2,
        label="parts left out in turn",
    )  # fmt: skip
    axes.plot(result.n, 100 * result.torque_error.validation, color="#d9730d", label="held out")
    axes.axhline(100 * float(own.full_error.mean()), color="#0b62c4", linewidth=0.8, linestyle=":")
    floor = (
        0.0 if data.log is None else estimate_noise_floor(data.log, data.reduction.nominal_torque)
    )
    if floor > 0:
        label = f"noise alone: {100 * floor:.2g} %"
        axes.axhline(100 * floor, color="#57606a", linewidth=1.0, linestyle="--", label=label)
    best = 100 * float(own.mean.min())
    axes.set_ylim(0, _OVER_BEST * best)
    mark_selected(axes, data)
    axes.set_xlabel(f"number of parameters n ({name})")
    axes.set_ylabel(r"$\varepsilon_\tau$, %")
    place_legend_beside(axes)
    return drawn
