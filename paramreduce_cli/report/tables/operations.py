"""Operation counts."""

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.sections import PageSection, placed
from paramreduce_cli.texts.table import Table


@placed(PageSection.SAVINGS, 1)
def operations(data: ReportData) -> Table:
    """Operations of the full, the base and the selected model: lean, plain recursion, the paper's rule."""
    selected = data.validation.selected
    result = data.validation.heuristics[selected.heuristic]
    keys = tuple(
        f"operations_{function}{rule}"
        for function in ("inverse", "direct")
        for rule in ("", "_plain", "_paper_rule")
    )
    affecting = int(data.model.affecting.sum())
    rows = [
        ("full", str(affecting), *(f"{data.validation.full[key]:.0f}" for key in keys)),
        (
            "base",
            str(data.model.base.columns.size),
            *(f"{data.validation.full[f'base_{key}']:.0f}" for key in keys),
        ),
        (
            selected.heuristic,
            str(selected.n),
            *(str(int(getattr(result, key)[result.row(selected.n)])) for key in keys),
        ),
    ]
    header = (
        "model", "n", "d, lean", "d, plain recursion", "d, the paper's rule",
        "[M, δ], lean", "[M, δ], plain recursion", "[M, δ], the paper's rule",
    )  # fmt: skip
    return Table("Operations", header, tuple(rows))
