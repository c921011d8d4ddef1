"""What to watch."""

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.texts.table import Table


@placed(PageSection.ACCELERATIONS, 3)
def remarks(data: ReportData) -> Table:
    """Warnings: models that should not be trusted, and why."""
    rows = [(str(warning.about), warning.text) for warning in data.validation.warnings]
    return Table("Warnings", ("about", "warning"), tuple(rows))
