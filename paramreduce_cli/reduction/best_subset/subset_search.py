"""The best subset of a size, with a proof: a search that can be stopped and continued."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from paramreduce_cli.multibody.orthogonal import DEPENDENT
from paramreduce_cli.records import FloatArray, IntArray
from paramreduce_cli.reduction.problem import SelectionProblem

if TYPE_CHECKING:
    from paramreduce_cli.reduction.best_subset.kernel import State

LARGEST_CONDITION = 1e5
"""Condition number of the non-zero spectrum up to which the search can certify: it updates
inverses of X'X, whose round-off grows with its square."""
RESOLUTION = 1e-9
"""Relative difference of squared errors that a proof does not resolve."""
_UPDATES = 1e-14
"""Round-off of the square root of a bound, as a multiple of the condition number."""
BEGINNING: IntArray = np.zeros(0, np.int64)
"""The log of a search that has not begun."""
_SLACK = 1e-12
"""Round-off of a squared error that is updated step by step; what is as near is calculated anew."""


@dataclass(frozen=True)
class GroupedProblem:
    """A selection problem with columns and chi of unit length, its columns numbered from zero.

    Attributes:
        X: Columns of unit length, (k, n_columns).
        chi: Right side of unit length, (k,).
        columns: Indices of the columns in the problem that this one was made from; columns of a group are adjacent.
        group: Number of the group that each column belongs to, (n_columns,).
        condition: Largest over smallest non-zero singular value of X.
        nearest: Smallest sine of the angle between two columns, those parallel to rounding aside.
        rank: Rank of X.
    """

    X: FloatArray
    chi: FloatArray
    columns: IntArray
    group: IntArray
    condition: float
    nearest: float
    rank: int

    @cached_property
    def fit(self) -> tuple[FloatArray, FloatArray, FloatArray, float]:
        """Fit of all columns: (X'X)^+, a basis of the null space, the solution, and the squared error left."""
        X, rank = self.X, self.rank
        U, s, Vt = np.linalg.svd(X, full_matrices=True)
        V = Vt[:rank].T
        solution = V @ ((U[:, :rank].T @ self.chi) / s[:rank])
        left = self.chi - X @ solution
        return (V / s[:rank] ** 2) @ V.T, Vt[rank:], solution, float(left @ left)

    @property
    def certifiable(self) -> bool:
        """Whether double precision is enough for proofs."""
        return self.condition <= LARGEST_CONDITION and self.nearest >= 1 / LARGEST_CONDITION


def normalise_problem(problem: SelectionProblem) -> GroupedProblem:
    """Scale the candidates' columns and chi to unit length; errors become shares of chi."""
    groups, columns = problem.groups, problem.columns
    X = problem.X[:, columns]
    s = np.linalg.svd(X, compute_uv=False)
    rank = int(np.sum(s > DEPENDENT * s[0]))
    group = np.repeat(np.arange(len(groups)), [u.size for u in groups])
    return GroupedProblem(
        X, problem.y, columns, group, float(s[0] / s[rank - 1]), _find_smallest_sine(X), rank
    )


def _find_smallest_sine(X: FloatArray) -> float:
    """Return the smallest sine between two columns that are not parallel."""
    sines = [1.0]
    for j in range(1, X.shape[1]):
        other = X[:, :j]
        rest = X[:, [j]] - other * (X[:, j] @ other)
        sines += np.linalg.norm(rest, axis=0).tolist()
    return min(sine for sine in sines if sine > DEPENDENT)


class Search:
    """A branch-and-bound search for the best subset of at most ``size`` columns.

    Args:
        problem: The columns.
        size: Columns that may be taken.
        squared_error: Squared error of the best subset known.
        subset: Best known subset, numbered like the columns of ``problem``.
        factor: Share of the best squared error that is searched for: below one, a finished
            search proves that much as a lower bound.
        log: State of an earlier search of the same kind; empty at the beginning.
    """

    def __init__(
        self,
        problem: GroupedProblem,
        size: int,
        squared_error: float,
        subset: IntArray,
        factor: float = 1.0,
        log: IntArray = BEGINNING,
    ) -> None:
        from paramreduce_cli.reduction.best_subset import kernel

        self._kernel, self._problem, self._factor = kernel, problem, factor
        self._data = kernel.Data(
            columns=np.ascontiguousarray(problem.X.T),
            chi=problem.chi,
            group=problem.group.astype(np.int64),
            first=np.searchsorted(problem.group, np.arange(problem.group[-1] + 1)),
            size=np.bincount(problem.group).astype(np.int64),
            slots=size,
            factor=factor * (1 - RESOLUTION),
            uncertainty=_UPDATES * problem.condition,
            slack=_SLACK,
        )
        self._state = self._make_root(problem, size, squared_error, subset)
        self.finished = False
        self.nodes = 0
        kernel.search(self._state, self._data, log.astype(np.int64), 0)

    def _make_root(
        self, problem: GroupedProblem, size: int, squared_error: float, subset: IntArray
    ) -> State:
        """Return the state at the root: all columns free."""
        kernel, X, chi = self._kernel, problem.X, problem.chi
        n, levels = X.shape[1], min(size, int(problem.group[-1]) + 1) + 2
        inverse, null, solution, left = problem.fit
        sheets = np.zeros((levels, 2 * n + len(null) + 2, n))
        sheets[0] = np.vstack([X.T @ X, inverse, null, X.T @ chi, solution])
        numbers = np.zeros((levels, kernel.FIRST + n), np.int64)
        numbers[0, kernel.FREE], numbers[0, kernel.NULLITY] = n, len(null)
        numbers[0, kernel.FIRST :] = np.arange(n)
        errors = np.zeros((levels, 2))
        errors[0] = chi @ chi, left
        found = np.full(n, -1, np.int64)
        found[: subset.size] = subset
        return kernel.State(
            sheets=sheets,
            numbers=numbers,
            errors=errors,
            included=np.zeros(n, np.int64),
            log=np.zeros(3 * n + 10, np.int64),
            progress=np.zeros(5, np.int64),
            basis=np.zeros((n, chi.size)),
            best=np.array([squared_error]),
            subset=found,
            spare=np.zeros(n),
        )

    def advance(self, nodes: int) -> None:
        """Go on for a limited number of nodes."""
        status, visited = self._kernel.search(self._state, self._data, BEGINNING, nodes)
        self.nodes += visited
        self.finished = status == self._kernel.DONE

    @property
    def depth(self) -> int | None:
        """Number of decisions above the waiting branch nearest to the root; None if no branch waits."""
        marks = np.flatnonzero(self.log == 0)
        return int(marks[0]) if marks.size and not self.finished else None

    def split(self) -> Search | None:
        """Make the branch that waits nearest to the root a search of its own, if there is one."""
        log, first = self.log, self.depth
        if first is None:
            return None
        given = self._continue_from(log[: first + 2])
        given._state.progress[self._kernel.GOING_BACK] = 1
        given.advance(0)
        # Without its mark the branch is a decision like those before it, and nothing waits there.
        own = self._continue_from(np.delete(log, first))._state
        own.progress[self._kernel.DOUBTFUL] += self._state.progress[self._kernel.DOUBTFUL]
        self._state = own
        return given

    def _continue_from(self, log: IntArray) -> Search:
        """Return a search that continues from a log of nodes."""
        slots = self._data.slots
        return Search(self._problem, slots, self.squared_error, self.subset, self._factor, log)

    def take_incumbent(self, squared_error: float, subset: IntArray) -> None:
        """Take over a better subset that another search of the same size has found."""
        if squared_error < self.squared_error:
            self._state.best[0] = squared_error
            self._state.subset[:] = -1
            self._state.subset[: subset.size] = subset

    @property
    def squared_error(self) -> float:
        """Squared error of the best subset found, as a share of that of chi."""
        return float(self._state.best[0])

    @property
    def subset(self) -> IntArray:
        """Best subset found, numbered as the columns of the problem."""
        found: IntArray = self._state.subset[self._state.subset >= 0]
        return found

    @property
    def is_uncertain(self) -> bool:
        """Whether a column was neither surely dependent nor surely not, so that nothing is proven."""
        return bool(self._state.progress[self._kernel.DOUBTFUL])

    @property
    def bound(self) -> float:
        """Lower bound on the squared error of every subset, as far as the search has come, less round-off."""
        bound = self._compute_bound()
        return float(max(0.0, np.sqrt(bound) - self._data.uncertainty) ** 2)

    def _compute_bound(self) -> float:
        """Return the squared error that no subset in the unsearched part is below."""
        searched = self.squared_error * self._data.factor
        if self.finished:
            return searched
        state = self._state
        level = max(int(state.progress[self._kernel.LEVEL]), 0)
        waiting = (self._bound_exclusion(k) for k in range(level))
        return min(searched, float(state.errors[level, self._kernel.BOUND]), *waiting)

    def _bound_exclusion(self, level: int) -> float:
        """Return the bound of the branch of a level that has not been searched: the one without the level's group."""
        kernel, state = self._kernel, self._state
        tableau, counters = state.sheets[level], state.numbers[level]
        n, nullity = tableau.shape[1], int(counters[kernel.NULLITY])
        free = counters[kernel.FIRST : kernel.FIRST + counters[kernel.FREE]]
        own = np.flatnonzero(self._data.group[free] == counters[kernel.BRANCH])
        if counters[kernel.NEAR]:
            return float(state.errors[level, kernel.BOUND])
        apart = np.sum(tableau[2 * n : 2 * n + nullity, own] ** 2, axis=0) <= kernel.APART
        rises = np.where(apart, tableau[-1, own] ** 2 / tableau[n + own, own], 0.0)
        return float(state.errors[level, kernel.BOUND] + rises.max())

    @property
    def log(self) -> IntArray:
        """Position of the search, from which it can continue later."""
        log: IntArray = self._state.log[: self._state.progress[self._kernel.LOGGED]].copy()
        return log


def compile_search() -> None:
    """Compile the search, once for all runs, so that no time limit pays for it."""
    X = np.linalg.qr(np.arange(1.0, 17.0).reshape(4, 4) ** 1.5)[0]
    problem = GroupedProblem(X, X.sum(axis=1) / 2, np.arange(4), np.arange(4), 1.0, 1.0, 4)
    Search(problem, 3, 1.0, np.zeros(0, np.int64), log=np.array([0, 1])).advance(100)
