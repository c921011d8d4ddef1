"""What each heuristic reaches at the selected number of parameters."""

from paramreduce_cli.records import ErrorRange
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.overview import HEADER, make_function_cells
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.texts.table import Table


@placed(PageSection.HEURISTICS, 1)
def summary(data: ReportData) -> Table:
    """All heuristics at the selected number of parameters, both functions.

    Errors are on the estimation set, the validation set, and the test set, which no search uses; there they are the
    median of all motions, and their range.
    """
    n = data.validation.selected.n
    full = data.validation.full
    model = (str(data.n_affecting), str(data.reduction.rank), str(n))
    rows = []
    for name, r in data.validation.heuristics.items():
        k = r.find_row(n)
        if k is not None:
            d, M = (
                make_function_cells(
                    key,
                    full.get(f"operations_{key}"),
                    r.operations[key][k],
                    r.get_errors(error).estimation[k],
                    r.get_errors(error).validation[k],
                    ErrorRange.summarise(r.get_errors(error).test[k]),
                )
                for key, error in (("inverse", "torque"), ("direct", "acceleration"))
            )
            rows.append((name, *model, *d, *M))
    known = [k for k in range(len(HEADER)) if any(row[k] != "-" for row in rows)]
    header, *rows = (tuple(row[k] for k in known) for row in (HEADER, *rows))
    return Table(f"Reduced models with {n} parameters", header, tuple(rows))
