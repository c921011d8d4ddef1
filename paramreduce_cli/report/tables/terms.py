"""Functions with pruned terms."""

import numpy as np

from paramreduce_cli.records import ErrorRange
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.style import FUNCTIONS
from paramreduce_cli.report.symbols import ACCELERATION_HEADINGS, TORQUE_HEADINGS
from paramreduce_cli.texts import format_percent, format_percent_range
from paramreduce_cli.texts.table import Table


@placed(PageSection.TERMS, 1)
def terms(data: ReportData) -> Table:
    """Functions with pruned terms.

    Errors are on the estimation set, the validation set, the test set, which no search uses, and random states inside
    the limits. The smallest eigenvalue is that of all mass matrices.
    """
    header = (
        "function", "n", "operations", "before", *TORQUE_HEADINGS, *ACCELERATION_HEADINGS, "torque error random",
        "accel. error random", "smallest eigenvalue",
    )  # fmt: skip
    rows = []
    labels = {key: label for key, label, _ in FUNCTIONS}
    for name, one in (data.terms.functions if data.terms is not None else {}).items():
        shown = (
            _format_error(one.torque_error.estimation), _format_error(one.torque_error.validation),
            format_percent_range(*ErrorRange.summarise(one.torque_error.test)),
            _format_error(one.acceleration_error.estimation), _format_error(one.acceleration_error.validation),
            format_percent_range(*ErrorRange.summarise(one.acceleration_error.test)),
            _format_error(one.random_torque_error), _format_error(one.random_acceleration_error),
        )  # fmt: skip
        eigenvalue = one.smallest_eigenvalue
        rows.append(
            (
                labels[name],
                str(one.values.size),
                str(one.operations),
                f"{one.operations_start}, {one.heuristic} with {one.n_start}",
                *shown,
                "-" if np.isnan(eigenvalue) else f"{eigenvalue:.3g}",
            )
        )
    return Table("Functions with pruned terms", header, tuple(rows))


def _format_error(error: float) -> str:
    """Return an error in per cent, a dash where it is not known."""
    return "-" if np.isnan(error) else format_percent(error)
