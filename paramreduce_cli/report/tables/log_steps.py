"""What was done to the log."""

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.texts.table import Table


@placed(PageSection.LOG, 1)
def log_steps(data: ReportData) -> Table:
    """Processing steps of the log, and warnings about it."""
    log = data.log
    rows = [] if log is None else [("done", text) for text in log.steps]
    rows += [] if log is None else [("warning", text) for text in log.warnings]
    return Table("The log", ("", "what"), tuple(rows))
