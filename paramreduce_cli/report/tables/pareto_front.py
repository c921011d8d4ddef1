"""The Pareto front."""

from paramreduce_cli.records import ErrorRange
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.symbols import ACCELERATION_HEADINGS, TORQUE_HEADINGS
from paramreduce_cli.texts import format_percent, format_percent_range
from paramreduce_cli.texts.table import Table


@placed(PageSection.SAVINGS, 4, tall=True)
def pareto_front(data: ReportData) -> Table:
    """Models that no other model beats in all quantities: errors on the estimation, the validation and the test set
    (median and range).
    """
    header = (
        "heuristic",
        "n",
        *TORQUE_HEADINGS,
        *ACCELERATION_HEADINGS,
        "operations inverse",
        "operations direct",
    )
    rows = []
    for model in data.validation.pareto:
        r = data.validation.heuristics[model.heuristic]
        k = r.find_row(model.n)
        errors = [
            text
            for what in ("torque", "acceleration")
            for text in (
                format_percent(float(r.get_errors(what).estimation[k])),
                format_percent(float(r.get_errors(what).validation[k])),
                format_percent_range(*ErrorRange.summarise(r.get_errors(what).test[k])),
            )
        ]
        counts = (r.operations.inverse, r.operations.direct)
        rows.append((model.heuristic, str(model.n), *errors, *(str(int(c[k])) for c in counts)))
    return Table("Pareto front", header, tuple(rows))
