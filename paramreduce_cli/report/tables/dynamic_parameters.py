"""The parameters of every body and payload."""

from paramreduce_cli.records import INERTIAL
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.texts.table import Table


@placed(PageSection.MECHANISM, 3)
def dynamic_parameters(data: ReportData) -> Table:
    """Standard parameters of every body and payload."""
    values = data.robot_model.values
    rows = [
        (rigid.name, *(f"{values[rigid.columns[kind]]:g}" for kind in INERTIAL))
        for rigid in data.robot_model.mechanism.rigid
    ]
    units = ", ".join(dict.fromkeys(kind.unit for kind in INERTIAL)).replace("^2", "²")
    header = ("body", *(kind.symbol for kind in INERTIAL))
    return Table(f"Standard parameters ({units})", header, tuple(rows))
