"""What each heuristic reaches at the selected number of parameters."""

from paramreduce_cli.records import ErrorRange
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.overview import HEADER, function_cells
from paramreduce_cli.report.sections import PageSection, placed
from paramreduce_cli.texts.table import Table


@placed(PageSection.HEURISTICS, 1)
def summary(data: ReportData) -> Table:
    """Every heuristic at the selected number of parameters, both functions: errors on the estimation (E), the validation (V) and the test set (T), which no search looks at, there the median of all motions and between the smallest and the largest."""
    n = data.validation.selected.n
    full = data.validation.full
    model = (str(data.n_affecting), str(data.reduction.rank), str(n))
    rows = []
    for name, r in data.validation.heuristics.items():
        k = r.find_row(n)
        if k is not None:
            d, M = (
                function_cells(
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
    return Table(f"Reduced models with {n} parameters", HEADER, tuple(rows))
