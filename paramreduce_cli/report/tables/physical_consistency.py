"""Standard parameters that a machine can have."""

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.sections import PageSection, placed
from paramreduce_cli.texts.table import Table


@placed(PageSection.IDENTIFICATION, 6)
def physical_consistency(data: ReportData) -> Table:
    """Body by body the smallest eigenvalue of the pseudo-inertia matrix, which is positive where a body can exist: of the fit nearest to the known parameters, and of the nearest physical one."""
    found = None if data.identification is None else data.identification.consistency
    rows = []
    if found is not None:
        for name, free, physical in zip(
            found.bodies, found.unconstrained_eigenvalues, found.smallest_eigenvalues, strict=True
        ):
            rows.append((name, _judged(free), _judged(physical)))
    return Table("Physical consistency", ("body", "free fit", "physical fit"), tuple(rows))


def _judged(eigenvalue: float) -> str:
    return f"{eigenvalue:.2g}" + ("" if eigenvalue > 0 else ", cannot exist")
