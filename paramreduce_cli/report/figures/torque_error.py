"""Torque error against n."""

from matplotlib.figure import Figure

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.sections import PageSection, placed
from paramreduce_cli.report.style import error_figure


@placed(PageSection.HEURISTICS, 2)
def torque_error(data: ReportData) -> Figure:
    """Torque error against the number of parameters, on both sets. What several heuristics found is drawn once, for the first of them."""
    return error_figure(data, "torque", r"$\varepsilon_\tau$")
