"""The subsets of one size."""

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.texts import format_percent
from paramreduce_cli.texts.table import Table


@placed(PageSection.PROOFS, 3)
def selected_subsets(data: ReportData) -> Table:
    """Parameters that every heuristic selects at the selected number of parameters."""
    n, names = data.validation.selected.n, data.reduction.columns.names
    rows = []
    for name, found in data.reduction.heuristics.items():
        row = found.find_row(n)
        if row is not None:
            kept = " ".join(names[k] for k in sorted(found.subsets[row]))
            rows.append((name, format_percent(float(found.torque_error[row])), kept))
    return Table(
        f"Subsets of {n} parameters", ("heuristic", "torque error est.", "parameters"), tuple(rows)
    )
