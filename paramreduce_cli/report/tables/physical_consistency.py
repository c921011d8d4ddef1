"""Standard parameters that a machine can have."""

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.texts.table import Table


@placed(PageSection.IDENTIFICATION, 6)
def physical_consistency(data: ReportData) -> Table:
    """Smallest eigenvalue of each body's pseudo-inertia matrix, which is positive for every possible body: of the fit
    nearest to the known parameters, and of the nearest physically consistent fit.
    """
    found = None if data.identification is None else data.identification.consistency
    rows = []
    if found is not None:
        for name, free, physical in zip(
            found.bodies, found.unconstrained_eigenvalues, found.smallest_eigenvalues, strict=True
        ):
            rows.append((name, _format_eigenvalue(free), _format_eigenvalue(physical)))
    return Table("Physical consistency", ("body", "free fit", "physical fit"), tuple(rows))


def _format_eigenvalue(eigenvalue: float) -> str:
    return f"{eigenvalue:.2g}" + ("" if eigenvalue > 0 else ", cannot exist")
