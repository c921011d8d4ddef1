"""How far the best subset of every size is proven."""

from paramreduce_cli.records import ProofStatus
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.texts import format_percent
from paramreduce_cli.texts.table import Table


@placed(PageSection.PROOFS, 2, tall=True)
def proofs(data: ReportData) -> Table:
    """Proven bounds on the error of the best subset, for every number of parameters."""
    found = data.reduction.proofs
    header = ("n", "torque error", "no subset below", "gap", "status", "nodes", "s")
    if found is None:
        return Table("Proofs: best-subset was not run", header, ())
    rows = []
    for k, n in enumerate(found.n):
        error, bound = float(found.torque_error[k]), float(found.lower_bound[k])
        closed = found.status[k] in (ProofStatus.OPTIMAL, ProofStatus.BEYOND_RANK)
        gap = "0" if closed else format_percent(1 - bound / error if error else 0.0)
        rows.append(
            (
                str(n), format_percent(error), format_percent(bound), gap, str(found.status[k]),
                str(found.nodes[k]), f"{found.seconds[k]:.2f}",
            )
        )  # fmt: skip
    return Table("Proofs of the best subsets", header, tuple(rows))
