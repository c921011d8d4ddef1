"""The selected model."""

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.texts.table import Table


@placed(PageSection.SELECTED, 1, tall=True)
def approximate_base_parameters(data: ReportData) -> Table:
    """Parameters of the selected model.

    Each is lumped: it takes over the part of the removed parameters that its column can reproduce. Values follow from
    the values in the config.
    """
    selected = data.validation.selected
    model = selected.model
    rows = [
        (str(k + 1), name, f"{value:.6g}", data.find_unit(parameter).replace("^2", "²"), expression)
        for k, (parameter, name, value, expression) in enumerate(
            zip(model.first, model.names, model.values, model.expressions, strict=True)
        )
    ]
    title = f"Approximate base parameters: {selected.heuristic}, n = {selected.n}"
    return Table(title, ("no.", "parameter", "φ' value", "unit", "made of"), tuple(rows))
