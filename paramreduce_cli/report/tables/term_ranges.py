"""Where functions with terms left out hold."""

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.sections import PageSection, placed
from paramreduce_cli.report.style import FUNCTIONS
from paramreduce_cli.texts.table import Table


@placed(PageSection.TERMS, 2)
def term_ranges(data: ReportData) -> Table:
    """Ranges of the estimation set, inside which functions with terms left out hold, and by joint the largest differences of torques, N m (N): on random states inside, with loops or measured torques on both sets."""
    functions = data.terms.functions if data.terms is not None else {}
    labels = {key: label for key, label, _ in FUNCTIONS}
    header = (
        "joint", "unit", "position", "velocity", "acceleration",
        *(f"difference of {labels[name]}" for name in functions),
    )  # fmt: skip
    rows: list[tuple[str, ...]] = []
    if functions:
        one = next(iter(functions.values()))
        mechanism = data.model.mechanism
        for j, joint in enumerate(mechanism.coordinate_names):
            extremes = zip(one.lower[:, j], one.upper[:, j], strict=True)
            ranges = (f"{low:.4g} to {high:.4g}" for low, high in extremes)
            unit = mechanism.bodies[mechanism.independent[j]].unit
            differences = (f"{each.largest_difference[j]:.3g}" for each in functions.values())
            rows.append((joint, unit, *ranges, *differences))
    return Table("Ranges of functions with terms left out", header, tuple(rows))
