"""Ties: one of equally good subsets is chosen, whichever a search has met first."""

import numpy as np

from paramreduce_cli.multibody.orthogonal import DEPENDENT
from paramreduce_cli.records import BoolArray, FloatArray, IntArray
from paramreduce_cli.reduction.best_subset.subset_search import RESOLUTION, GroupedProblem


def find_ties(squared_errors: FloatArray, best: float) -> BoolArray:
    """Return which errors equal the best one up to the resolution of a proof."""
    return squared_errors <= best * (1 + RESOLUTION)


def find_first_tie(problem: GroupedProblem, subset: IntArray, squared_error: float) -> IntArray:
    """Return the first subset, in lexicographic order, of those with the same error that single swaps reach.

    Subsets that span the same space are the bases of a matroid. The first basis is reached from any other by swaps of
    which each gives an earlier basis.

    Args:
        problem: Problem with the columns; if a group has several columns, nothing is swapped.
        subset: Numbered as its columns.
        squared_error: Squared error of the subset, a share of that of chi.

    Returns:
        A subset as large, sorted.
    """
    found = np.sort(subset)
    if problem.group[-1] + 1 < problem.group.size:
        return found
    place = 0
    while place < found.size:
        earlier = np.setdiff1d(np.arange(found[place]), found)
        errors = _compute_errors_with(problem, np.delete(found, place), earlier)
        ties = earlier[find_ties(errors, squared_error)]
        if ties.size:
            found = np.sort(np.append(np.delete(found, place), ties[0]))
            place = 0
        else:
            place += 1
    return found


def _compute_errors_with(problem: GroupedProblem, kept: IntArray, others: IntArray) -> FloatArray:
    """Return the squared errors of a subset with one further column each."""
    U, s, _ = np.linalg.svd(problem.X[:, kept], full_matrices=False)
    basis = U[:, s > DEPENDENT * s.max(initial=0.0)]
    left = problem.chi - basis @ (basis.T @ problem.chi)
    further = problem.X[:, others]
    for _ in range(2):  # once leaves round-off of columns that are nearly dependent
        further = further - basis @ (basis.T @ further)
    lengths = np.linalg.norm(further, axis=0)
    apart = lengths > DEPENDENT
    reached = np.where(apart, left @ further / np.where(apart, lengths, 1.0), 0.0)
    return np.asarray(left @ left - reached**2)
