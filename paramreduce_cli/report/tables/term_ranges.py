"""Where functions with pruned terms hold, and where they were looked at besides."""

import numpy as np

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.texts.table import Table


@placed(PageSection.TERMS, 2)
def term_ranges(data: ReportData) -> Table:
    """Ranges of the estimation set, inside which pruned functions hold, and ranges of the random states that they are
    also evaluated on: limits of the config, or ranges of the set where there is no limit.
    """
    functions = data.terms.functions if data.terms is not None else {}
    kinds = ("position", "velocity", "acceleration")
    header = ("joint", "unit", *kinds, *(f"random {kind}" for kind in kinds))
    rows: list[tuple[str, ...]] = []
    if functions:
        one = max(functions.values(), key=lambda one: one.mass_states)
        mechanism = data.robot_model.mechanism
        for j, joint in enumerate(mechanism.coordinate_names):
            extremes = (*zip(one.lower[:, j], one.upper[:, j], strict=True), *one.drawn[:, :, j].T)
            unit = mechanism.bodies[mechanism.independent[j]].unit
            shown = (
                f"{low:.4g} to {high:.4g}" if not np.isnan(low) else "-" for low, high in extremes
            )
            rows.append((joint, unit, *shown))
    return Table("Ranges of functions with pruned terms", header, tuple(rows))
