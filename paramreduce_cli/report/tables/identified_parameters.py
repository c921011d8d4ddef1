"""Identified base parameters."""

import numpy as np

from paramreduce_cli.records import Estimate
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.texts.measured_values import format_measured
from paramreduce_cli.texts.table import Table


@placed(PageSection.IDENTIFICATION, 5, tall=True)
def identified_parameters(data: ReportData) -> Table:
    """Values, standard deviations, and half widths of the 95 % intervals relative to the values: of payloads
    identified alone, of the reduced model, then of all base parameters.
    """
    found = data.identification
    rows: list[tuple[str, ...]] = []
    if found is not None:
        alone = [] if found.payload is None else _list_rows("payload", found.payload)
        rows = [*alone, *_list_rows("reduced", found.reduced), *_list_rows("all", found.full)]
    header = ("model", "parameter", "value", "std. dev.", "95 % interval, ± %")
    return Table("Identified parameters", header, tuple(rows))


def _list_rows(model: str, estimate: Estimate) -> list[tuple[str, ...]]:
    """Return a row for every parameter of an estimate."""
    relative = 100 * estimate.half_widths / np.maximum(np.abs(estimate.values), 1e-300)
    cells = zip(estimate.names, estimate.values, estimate.deviations, relative, strict=True)
    return [
        (model, name, *format_measured(value, deviation), f"{percent:.2g}")
        for name, value, deviation, percent in cells
    ]
