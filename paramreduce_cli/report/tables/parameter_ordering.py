"""The orders of the heuristics."""

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.texts.table import Table


@placed(PageSection.ORDERING, 1, tall=True)
def parameter_ordering(data: ReportData) -> Table:
    """Order in which each heuristic adds the parameters."""
    found = data.reduction.heuristics
    orders = {name: f.order for name, f in found.items() if f.order is not None}
    names = data.reduction.columns.names
    longest = max((order.size for order in orders.values()), default=0)
    rows = [
        (str(k + 1), *(names[order[k]] if k < order.size else "" for order in orders.values()))
        for k in range(longest)
    ]
    return Table("Parameter ordering", ("no.", *orders), tuple(rows))
