"""The Pareto front."""

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.sections import PageSection, placed
from paramreduce_cli.texts import share
from paramreduce_cli.texts.table import Table


@placed(PageSection.SAVINGS, 4, tall=True)
def pareto_front(data: ReportData) -> Table:
    """Models that no other one beats in all respects."""
    header = ("heuristic", "n", "ε_τ E", "ε_τ V", "ε_z̈ E", "ε_z̈ V", "d", "M, δ")
    rows = []
    for model in data.validation.pareto:
        r = data.validation.heuristics[model.heuristic]
        k = r.row(model.n)
        errors = (
            r.torque_error_estimation, r.torque_error_validation,
            r.acceleration_error_estimation, r.acceleration_error_validation,
        )  # fmt: skip
        counts = (r.operations_inverse, r.operations_direct)
        cells = (*(share(float(e[k])) for e in errors), *(str(int(c[k])) for c in counts))
        rows.append((model.heuristic, str(model.n), *cells))
    return Table("Pareto front", header, tuple(rows))
