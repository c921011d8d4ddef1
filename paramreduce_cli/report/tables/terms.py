"""Functions with terms left out."""

import numpy as np

from paramreduce_cli.records import ErrorRange
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.sections import PageSection, placed
from paramreduce_cli.report.style import FUNCTIONS
from paramreduce_cli.texts import format_percent, format_percent_range
from paramreduce_cli.texts.table import Table


@placed(PageSection.TERMS, 1)
def terms(data: ReportData) -> Table:
    """Errors on the estimation (E), the validation (V) and the test set (T), which no search looks at, and on random states inside the limits, and the smallest eigenvalue of all mass matrices, on both sets and random states."""
    header = (
        "function", "n", "operations", "before", "ε_τ E", "ε_τ V", "ε_τ T", "ε_z̈ E", "ε_z̈ V", "ε_z̈ T", "ε_τ random",
        "ε_z̈ random", "smallest eigenvalue",
    )  # fmt: skip
    rows = []
    labels = {key: label for key, label, _ in FUNCTIONS}
    for name, one in (data.terms.functions if data.terms is not None else {}).items():
        shown = (
            _known(one.torque_error.estimation), _known(one.torque_error.validation),
            format_percent_range(*ErrorRange.summarise(one.torque_error.test)),
            _known(one.acceleration_error.estimation), _known(one.acceleration_error.validation),
            format_percent_range(*ErrorRange.summarise(one.acceleration_error.test)),
            _known(one.random_torque_error), _known(one.random_acceleration_error),
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
    return Table("Functions with terms left out", header, tuple(rows))


def _known(error: float) -> str:
    """A share; a dash where it is not known."""
    return "-" if np.isnan(error) else format_percent(error)
