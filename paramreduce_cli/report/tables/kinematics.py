"""The geometry of the mechanism, as its config gives it."""

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.texts.table import Table


@placed(PageSection.MECHANISM, 2)
def kinematics(data: ReportData) -> Table:
    """Geometry as the config gives it."""
    header, *rows = data.robot_model.mechanism.table
    return Table("Kinematic parameters (m, rad)", header, tuple(rows))
