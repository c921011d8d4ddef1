"""The best subset of every size by branch and bound."""

from paramreduce_cli.reduction.best_subset.proofs import ProofSearch
from paramreduce_cli.reduction.task import FoundSubsets, SelectionTask, run, sort_by_size


def best_subset(task: SelectionTask) -> FoundSubsets:
    """Find the best subset of every size by branch and bound, and prove it.

    The swap search gives the starts. If time or nodes run out, or on Ctrl-C, the best subset found and a lower bound of
    the error are kept; a later run continues from there.
    """
    search = ProofSearch(task, run("swap", task).subsets)
    search.run()
    return FoundSubsets(
        sort_by_size(task.objective, search.list_subsets()).subsets, search.record()
    )
