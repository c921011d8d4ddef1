"""The parameters of every body."""

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.sections import PageSection, placed
from paramreduce_cli.report.table import Table


@placed(PageSection.MECHANISM, 3)
def dynamic_parameters(data: ReportData) -> Table:
    """The parameters of every body."""
    parameters = data.model.mechanism.parameters
    kinds = list(dict.fromkeys(parameter.kind for parameter in parameters))
    values = {(p.owner, p.kind): v for p, v in zip(parameters, data.model.values, strict=True)}
    rows = [
        (owner, *(f"{values[owner, kind]:g}" if (owner, kind) in values else "" for kind in kinds))
        for owner in dict.fromkeys(parameter.owner for parameter in parameters)
    ]
    units = ", ".join(dict.fromkeys(kind.unit for kind in kinds)).replace("^2", "²")
    return Table(
        f"Standard parameters ({units})", ("body", *(kind.symbol for kind in kinds)), tuple(rows)
    )
