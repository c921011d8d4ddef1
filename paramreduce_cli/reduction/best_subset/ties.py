"""Subsets that are as good as each other: one of them is chosen, whichever a search has met first."""

import numpy as np

from paramreduce_cli.multibody.orthogonal import DEPENDENT
from paramreduce_cli.records import BoolArray, FloatArray, IntArray
from paramreduce_cli.reduction.best_subset.search import RESOLUTION, UnitProblem


def as_good(squared_errors: FloatArray, best: float) -> BoolArray:
    """Which errors are no larger than the best one but for what a proof does not resolve."""
    return squared_errors <= best * (1 + RESOLUTION)


def first_of_ties(problem: UnitProblem, subset: IntArray, squared_error: float) -> IntArray:
    """Of subsets as good as one, the first by its columns' numbers that exchanges of one column lead to.

    Subsets that span the same space are the bases of a matroid, whose first one is reached from any other by exchanges
    that each make it come earlier.

    Args:
        problem: The columns; groups of them are not exchanged.
        subset: Numbered as its columns.
        squared_error: Of the subset, a share of that of chi.

    Returns:
        A subset as large, sorted.
    """
    found = np.sort(subset)
    if problem.unit[-1] + 1 < problem.unit.size:
        return found
    place = 0
    while place < found.size:
        earlier = np.setdiff1d(np.arange(found[place]), found)
        errors = _errors_with(problem, np.delete(found, place), earlier)
        ties = earlier[as_good(errors, squared_error)]
        if ties.size:
            found = np.sort(np.append(np.delete(found, place), ties[0]))
            place = 0
        else:
            place += 1
    return found


def _errors_with(problem: UnitProblem, kept: IntArray, others: IntArray) -> FloatArray:
    """Squared errors of a subset with one further column each."""
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
