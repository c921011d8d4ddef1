"""Functions with pruned terms."""

import numpy as np

from paramreduce_cli.records import ErrorRange
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.style import FUNCTIONS
from paramreduce_cli.texts import format_percent, format_percent_range
from paramreduce_cli.texts.table import Table


@placed(PageSection.TERMS, 1)
def terms(data: ReportData) -> Table:
    """Functions with pruned terms.

    Errors on the estimation (E), the validation (V) and the test set (T), which no search uses, and on random states
    inside the limits; smallest eigenvalue of all mass matrices.
    """
    header = (
        "function", "n", "operations", "before", "torque error est.", "torque error val.", "torque error test", "accel. error est.", "accel. error val.", "accel. error test", "torque error random",
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
