"""Where functions with terms left out hold, and where they were looked at besides."""

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.sections import PageSection, placed
from paramreduce_cli.texts.table import Table


@placed(PageSection.TERMS, 2)
def term_ranges(data: ReportData) -> Table:
    """Ranges of the estimation set, inside which functions with terms left out hold, and limits of the config, inside which random states are looked at; where there are no limits, these are the ranges."""
    functions = data.terms.functions if data.terms is not None else {}
    kinds = ("position", "velocity", "acceleration")
    header = ("joint", "unit", *kinds, *(f"{kind} limits" for kind in kinds))
    rows: list[tuple[str, ...]] = []
    if functions:
        one = next(iter(functions.values()))
        mechanism = data.model.mechanism
        for j, joint in enumerate(mechanism.coordinate_names):
            extremes = (*zip(one.lower[:, j], one.upper[:, j], strict=True), *one.limits[:, :, j].T)
            unit = mechanism.bodies[mechanism.independent[j]].unit
            rows.append((joint, unit, *(f"{low:.4g} to {high:.4g}" for low, high in extremes)))
    return Table("Ranges of functions with terms left out", header, tuple(rows))
