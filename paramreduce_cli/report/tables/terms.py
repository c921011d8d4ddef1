"""Functions with terms left out."""

import numpy as np

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.sections import PageSection, placed
from paramreduce_cli.report.style import FUNCTIONS
from paramreduce_cli.texts import share
from paramreduce_cli.texts.table import Table


@placed(PageSection.TERMS, 1)
def terms(data: ReportData) -> Table:
    """Errors on the estimation (E) and the validation set (V) and on random states inside the limits, and the smallest eigenvalue of all mass matrices, on both sets and random states."""
    header = (
        "function", "n", "operations", "before", "ε_τ E", "ε_τ V", "ε_z̈ E", "ε_z̈ V", "ε_τ random",
        "ε_z̈ random", "smallest eigenvalue",
    )  # fmt: skip
    rows = []
    labels = {key: label for key, label, _ in FUNCTIONS}
    for name, one in (data.terms.functions if data.terms is not None else {}).items():
        errors = (
            one.torque_error_estimation, one.torque_error_validation,
            one.acceleration_error_estimation, one.acceleration_error_validation,
            one.random_torque_error, one.random_acceleration_error,
        )  # fmt: skip
        shown = ("-" if np.isnan(error) else share(error) for error in errors)
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
