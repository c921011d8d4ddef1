"""Torque error against n."""

from matplotlib.figure import Figure

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.style import draw_errors


@placed(PageSection.PAPER, 1)
def torque_error(data: ReportData) -> Figure:
    """Torque error against the number of parameters. Heuristics that found the same models share a curve."""
    return draw_errors(data, "torque", r"$\varepsilon_\tau$")
