"""The base parameters."""

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.texts.table import Table


@placed(PageSection.BASE, 1, tall=True)
def base_parameters(data: ReportData) -> Table:
    """Base parameters and the standard parameters that are regrouped in each."""
    base = data.robot_model.base
    rows = [
        (str(k + 1), expression, f"{value:.6g}")
        for k, (expression, value) in enumerate(
            zip(base.expressions, data.robot_model.base_values, strict=True)
        )
    ]
    return Table("Base parameters", ("no.", "expression", "value"), tuple(rows))
