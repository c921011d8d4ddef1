"""What residuals suggest."""

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.texts.table import Table


@placed(PageSection.IDENTIFICATION, 0)
def hints(data: ReportData) -> Table:
    """Likely causes of the residuals, the strongest first, and the reduced model compared with all base parameters."""
    found = data.identification
    rows: list[tuple[str, str]] = []
    if found is not None:
        rows = [("comparison", found.comparison), *(("hint", text) for text in found.hints)]
        if found.payload is not None:
            text = f"{100 * found.payload.held_out:.3g} % of the held-out torques are unexplained by the payload alone."
            rows.append(("payload", text))
        if found.consistency is not None:
            verdict = "can exist" if found.consistency.positive else "do not all exist"
            text = f"{100 * found.consistency.held_out:.3g} % held out"
            rows.append(("physical", f"Bodies and drives of the physical fit {verdict}; {text}."))
    return Table("What the measurements say", ("", "what"), tuple(rows))
