"""Operation counts."""

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.texts.table import Table


@placed(PageSection.SAVINGS, 1)
def operations(data: ReportData) -> Table:
    """Operations of the full, the base and the selected model: lean code, textbook recursion, and textbook recursion by
    the paper's rule.
    """
    selected = data.validation.selected
    keys = tuple(
        f"operations_{function}{rule}"
        for function in ("inverse", "direct")
        for rule in ("", "_plain", "_paper_rule")
    )
    affecting, base = int(data.robot_model.affecting.sum()), data.robot_model.base.columns.size
    named = [("full", affecting, ""), ("base", base, "base_")]
    named.append((selected.heuristic, selected.n, "selected_"))
    rows = [
        (name, str(n), *(f"{data.validation.full[prefix + key]:.0f}" for key in keys))
        for name, n, prefix in named
    ]
    header = (
        "model", "n", "inverse, lean", "inverse, textbook", "inverse, paper's rule",
        "direct, lean", "direct, textbook", "direct, paper's rule",
    )  # fmt: skip
    return Table("Operations", header, tuple(rows))
