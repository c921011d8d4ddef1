"""Acceleration error against n."""

from matplotlib.figure import Figure

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.style import draw_errors


@placed(PageSection.PAPER, 4, of_mechanism=True)
def acceleration_error(data: ReportData) -> Figure:
    """Error of the accelerations against the number of parameters. Heuristics that found the same models share a curve."""
    return draw_errors(data, "acceleration", r"$\varepsilon_{\ddot z}$")
