"""Branch and bound over the columns of a least-squares problem, compiled by Numba.

At every node some columns are included, some are free and the others excluded. Two forms are
kept over the free columns, both brought up to date in O(n^2) when one is included or excluded:

* what the included columns leave: the Gram matrix X'X and the moments X'e of the residuals, and
  the squared error INSIDE of the included columns alone;
* the fit with all included and free columns: the inverse (X'X)^+, the solution X^+ chi, an
  orthonormal basis of the null space, and BOUND, the squared error it leaves. No subset below
  the node has a smaller one.

The search goes depth first and stops after a number of nodes; its state is all in arrays, and
the log repeats the way to where it stands.

A node is three arrays:

* ``sheet``, one free column a column: n rows of the Gram matrix, n of the inverse, the basis of
  the null space, then moments and solution;
* ``numbers``: how many columns are FREE, the NULLITY, how many are INCLUDED, which group was taken
  (BRANCH) and the length of the log then (MARK), whether the included and free columns are
  nearly dependent (NEAR), and from FIRST on which columns are free;
* ``errors``: INSIDE and BOUND.
"""

from typing import NamedTuple, cast

import numpy as np

from paramreduce_cli.expressions.loops import compile_loop, inline
from paramreduce_cli.multibody.orthogonal import DEPENDENT
from paramreduce_cli.records import FloatArray, IntArray

GONE = 1e-13
"""Squared share of a column's length below which nothing but round-off is left of it."""
SURE = 1e-6
"""Squared share from which on the Gram matrix is known well enough to go on with; below, it is
calculated anew from the columns."""
ROUND_OFF = 1e-13
"""Round off of the entries of the Gram matrix, after steps with pivots of SURE and more."""
APART = 1e-18
"""Squared share in the null space below which a column takes no part in it."""
REAL = 1e-6
"""Share of a column's length from which on it is surely independent; between this and DEPENDENT
nothing is certified."""
INVOLVED = 1e-10
"""Squared share from which on a column can be excluded by an update; below, those that stay are
nearly dependent, and the fit is calculated anew."""
NEARLY = 1e-5
"""Smallest over largest singular value at which columns are called nearly dependent: then bounds
are lowered by what is uncertain, and none is included by force."""

FREE, NULLITY, INCLUDED, BRANCH, MARK, NEAR, FIRST = 0, 1, 2, 3, 4, 5, 6
INSIDE, BOUND = 0, 1
LEVEL, GOING_BACK, LOGGED, SPANNED, DOUBTFUL = 0, 1, 2, 3, 4
DONE, PAUSED = 0, 1
# What is handed on is not written as a plain number: for each of those Numba compiles a function anew.
_NO_COLUMN = cast("int", np.int64(-1))
_GRAM = cast("int", np.int64(0))
_INCLUDE, _EXCLUDE = cast("tuple[bool, bool]", (np.bool_(True), np.bool_(False)))

_within = compile_loop(within=True, makes_arrays=False)
_making_arrays = compile_loop(within=True)


class Data(NamedTuple):
    """A record of what does not change during a search; columns and chi have unit length."""

    columns: FloatArray
    """One column of W a row, (n_columns, k)."""
    chi: FloatArray
    """(k,)"""
    group: IntArray
    """Number of the group that each column belongs to, (n_columns,)."""
    first: IntArray
    """First column of each group, whose columns stand together, (n_groups,)."""
    size: IntArray
    """Columns of each group, (n_groups,)."""
    slots: int
    """Columns that may be included."""
    factor: float
    """Share of the best squared error that a subset must be below."""
    uncertainty: float
    """Uncertainty of the square root of a bound."""
    slack: float
    """Uncertainty of INSIDE; what is within it is calculated anew."""


class State(NamedTuple):
    """A state of a search; a level is a node on the path from the root, one per branch."""

    sheets: FloatArray
    """(n_levels, 2 n_columns + nullity + 2, n_columns)"""
    numbers: IntArray
    """(n_levels, FIRST + n_columns)"""
    errors: FloatArray
    """(n_levels, 2)"""
    included: IntArray
    """Columns of the current node, (n_columns,)."""
    log: IntArray
    """Decisions on the way here: 0 before a branch, group + 1 included, -group - 1 excluded."""
    progress: IntArray
    """LEVEL, whether to go back from it, length of the log, how many directions of the included
    columns are known (SPANNED), and how often a column was neither surely dependent nor surely
    not (DOUBTFUL), (5,)."""
    basis: FloatArray
    """Directions of the included columns, zero for those that depend on others, (n_columns, k)."""
    best: FloatArray
    """The smallest squared error found, (1,)."""
    subset: IntArray
    """Columns of the subset, then -1, (n_columns,)."""
    spare: FloatArray
    """Room to work in, (n_columns,)."""


@inline
def _copy_vector(given: FloatArray | IntArray, to: FloatArray | IntArray) -> None:
    """Copy a vector; assigned as a whole it takes Numba seconds to compile that shapes are compared."""
    for i in range(to.size):
        to[i] = given[i]


@_within
def _find_position(counters: IntArray, column: int) -> int:
    """Return the position of a column among the free columns, or -1."""
    for j in range(counters[FREE]):
        if counters[FIRST + j] == column:
            return j
    return -1


@_within
def _drop(tableau: FloatArray, counters: IntArray, j: int) -> None:
    """Put the last free column in place of column j."""
    n, last = tableau.shape[1], counters[FREE] - 1
    counters[FREE] = last
    if j == last:
        return
    counters[FIRST + j] = counters[FIRST + last]
    for start in (0, n):
        for k in range(last + 1):
            tableau[start + j, k] = tableau[start + last, k]
        for i in range(last):
            tableau[start + i, j] = tableau[start + i, last]
    for row in range(2 * n, tableau.shape[0]):
        tableau[row, j] = tableau[row, last]


@_within
def _sweep(tableau: FloatArray, start: int, row: int, j: int, column_errors: FloatArray) -> None:
    """Sweep column j out of the matrix and the vector of one form; its own entries are not used again.

    The loop handles one row at a time, with a copy of row j, because only then the compiler vectorises it.
    """
    n = column_errors.size
    for k in range(n):
        column_errors[k] = tableau[start + j, k]
    pivot = 1.0 / column_errors[j]
    for i in range(n):
        if i != j:
            line = tableau[start + i, :n]
            part = column_errors[i] * pivot
            for k in range(n):
                line[k] -= part * column_errors[k]
    line = tableau[row, :n]
    step = line[j] * pivot
    for k in range(n):
        line[k] -= step * column_errors[k]


@_within
def _compute_null_fraction(tableau: FloatArray, nullity: int, j: int) -> float:
    """Return the squared share of a column in the null space of all included and free columns."""
    start, fraction = 2 * tableau.shape[1], 0.0
    for c in range(nullity):
        fraction += tableau[start + c, j] * tableau[start + c, j]
    return fraction


@inline
def _exclude(
    tableau: FloatArray, counters: IntArray, errors: FloatArray, s: State, data: Data, j: int
) -> None:
    """Exclude a free column, and raise the bound by what the exclusion costs."""
    n, row = tableau.shape[1], tableau.shape[0] - 1
    fraction = _compute_null_fraction(tableau, counters[NULLITY], j)
    # Round-off may leave nothing of what an exclusion costs where columns are nearly dependent.
    known = fraction > APART or tableau[n + j, j] > 0
    if counters[NEAR] == 1 or APART < fraction < INVOLVED or not known:
        _drop(tableau, counters, j)
        _refit(tableau, counters, errors, s, data)
        return
    if fraction > APART:
        _exclude_dependent(tableau, counters, j, fraction)
    else:
        errors[BOUND] += tableau[row, j] ** 2 / tableau[n + j, j]
        _sweep(tableau, n, row, j, s.spare[: counters[FREE]])
    _drop(tableau, counters, j)


@_making_arrays
def _refit(
    tableau: FloatArray, counters: IntArray, errors: FloatArray, s: State, data: Data
) -> None:
    """Fit all included and free columns from the columns themselves.

    If the decomposition of a large matrix does not converge, which is rare, the bound of more columns stays, and the
    next exclusion starts again.
    """
    n, free, count = tableau.shape[1], counters[FREE], counters[INCLUDED]
    rows = np.empty((free + count, data.chi.size))
    for j in range(free):
        _copy_vector(data.columns[counters[FIRST + j]], rows[j])
    for k in range(count):
        _copy_vector(data.columns[s.included[k]], rows[free + k])
    left, values, right = np.empty((0, 0)), np.empty(0), np.empty((0, 0))
    converged = True
    try:
        left, values, right = np.linalg.svd(rows, full_matrices=True)
    except Exception:
        converged = False
    if not converged:
        counters[NEAR] = 1
        return
    rank = 0
    while rank < values.size and values[rank] > DEPENDENT * values[0]:
        rank += 1
    spanned = np.ascontiguousarray(right[:rank])
    inner = spanned @ data.chi
    rest = data.chi - inner @ spanned
    own = np.ascontiguousarray(left[:free, :rank])
    inverse = (own / values[:rank] ** 2) @ np.ascontiguousarray(own.T)
    for i in range(free):
        _copy_vector(inverse[i], tableau[n + i, :free])
    counters[NULLITY] = min(free + count - rank, tableau.shape[0] - 2 * n - 2)
    for c in range(counters[NULLITY]):
        _copy_vector(left[:free, rank + c], tableau[2 * n + c, :free])
    _copy_vector(own @ (inner / values[:rank]), tableau[tableau.shape[0] - 1, :free])
    ratio = values[rank - 1] / values[0] if rank > 0 else 1.0
    counters[NEAR] = 1 if ratio < NEARLY else 0
    length = np.sqrt(np.dot(rest, rest)) - ROUND_OFF / ratio
    errors[BOUND] = max(errors[BOUND], max(length, 0.0) ** 2)


@_making_arrays
def _exclude_dependent(
    tableau: FloatArray, counters: IntArray, j: int, null_fraction: float
) -> None:
    """Exclude column j, which depends on the others: shift its coefficient to them along the null space, so the fit
    stays the same.
    """
    n, row = tableau.shape[1], tableau.shape[0] - 1
    free, nullity, start = counters[FREE], counters[NULLITY], 2 * n
    along = np.zeros(free)
    for c in range(nullity):
        for i in range(free):
            along[i] += tableau[start + c, i] * tableau[start + c, j] / null_fraction
    old = tableau[n + j, :free].copy()
    amount, own = tableau[row, j], old[j]
    for i in range(free):
        tableau[row, i] -= along[i] * amount
        for k in range(free):
            tableau[n + i, k] += along[i] * along[k] * own - along[i] * old[k] - old[i] * along[k]
    # A reflection turns the basis so that only its last vector has a part in column j.
    mirror = tableau[start : start + nullity, j].copy()
    mirror[nullity - 1] += (
        np.sqrt(null_fraction) if mirror[nullity - 1] >= 0 else -np.sqrt(null_fraction)
    )
    squared = np.sum(mirror**2)
    for i in range(free):
        total = 0.0
        for c in range(nullity):
            total += tableau[start + c, i] * mirror[c]
        for c in range(nullity):
            tableau[start + c, i] -= 2 * total / squared * mirror[c]
    counters[NULLITY] = nullity - 1


@_making_arrays
def _project_out(basis: FloatArray, count: int, column: FloatArray) -> FloatArray:
    """Return a column without its components along some directions."""
    left: FloatArray = column.copy()
    known = basis[:count]
    for _ in range(2):
        left -= np.dot(np.dot(known, left), known)
    return left


@_making_arrays
def _span(s: State, data: Data, count: int) -> None:
    """Find the directions of the first included columns, as far as they are not known."""
    for k in range(s.progress[SPANNED], count):
        left = _project_out(s.basis, k, data.columns[s.included[k]])
        length = np.sqrt(np.dot(left, left))
        if DEPENDENT < length < REAL:
            s.progress[DOUBTFUL] += 1
        _copy_vector(left / length if length > DEPENDENT else 0.0 * left, s.basis[k])
    s.progress[SPANNED] = max(s.progress[SPANNED], count)


@inline
def _include(
    tableau: FloatArray, counters: IntArray, errors: FloatArray, s: State, data: Data, j: int
) -> None:
    """Move the column at position j out of the free ones; the last free column takes its position, and the error falls
    by what the column explains. The caller has listed the column as included.
    """
    own, row = tableau[j, j], tableau.shape[0] - 2
    if own > SURE:
        errors[INSIDE] -= tableau[row, j] ** 2 / own
        _sweep(tableau, _GRAM, row, j, s.spare[: counters[FREE]])
    _drop(tableau, counters, j)
    if GONE < own <= SURE:
        _recompute(tableau, counters, errors, s, data)


@_making_arrays
def _recompute(
    tableau: FloatArray, counters: IntArray, errors: FloatArray, s: State, data: Data
) -> None:
    """Compute from the columns themselves what the included columns leave."""
    free, row = counters[FREE], tableau.shape[0] - 2
    count = counters[INCLUDED]
    _span(s, data, count)
    left = _project_out(s.basis, count, data.chi)
    rest = np.empty((free, left.size))
    for j in range(free):
        _copy_vector(_project_out(s.basis, count, data.columns[counters[FIRST + j]]), rest[j])
        tableau[row, j] = np.dot(rest[j], left)
        for i in range(j + 1):
            tableau[i, j] = tableau[j, i] = np.dot(rest[i], rest[j])
    errors[INSIDE] = np.dot(left, left)


@_within
def _decide(
    tableau: FloatArray, counters: IntArray, errors: FloatArray, s: State, data: Data, group: int,
    include: bool,
) -> None:  # fmt: skip
    """Include or exclude all columns of a group."""
    progress = s.progress
    s.log[progress[LOGGED]] = group + 1 if include else -group - 1
    progress[LOGGED] += 1
    first = data.first[group]
    for column in range(first, first + data.size[group]):
        j = _find_position(counters, column)
        if include:
            s.included[counters[INCLUDED]] = column
            progress[SPANNED] = min(progress[SPANNED], counters[INCLUDED])
            counters[INCLUDED] += 1
            _include(tableau, counters, errors, s, data, j)
        else:
            _exclude(tableau, counters, errors, s, data, j)


@inline
def _branch(s: State, data: Data, group: int) -> None:
    """Keep the node for later, and continue with a copy that includes a group."""
    level = s.progress[LEVEL]
    tableau, counters = s.sheets[level], s.numbers[level]
    counters[BRANCH], counters[MARK] = group, s.progress[LOGGED]
    s.log[s.progress[LOGGED]] = 0
    s.progress[LOGGED] += 1
    s.progress[LEVEL] = level + 1
    deeper = s.sheets[level + 1]
    n, free = tableau.shape[1], counters[FREE]
    for start in (0, n):
        for i in range(free):
            for k in range(free):
                deeper[start + i, k] = tableau[start + i, k]
    for row in range(2 * n, tableau.shape[0]):
        for k in range(free):
            deeper[row, k] = tableau[row, k]
    for k in range(FIRST + free):
        s.numbers[level + 1, k] = counters[k]
    s.errors[level + 1, INSIDE] = s.errors[level, INSIDE]
    s.errors[level + 1, BOUND] = s.errors[level, BOUND]
    _decide(deeper, s.numbers[level + 1], s.errors[level + 1], s, data, group, _INCLUDE)


@_making_arrays
def _is_parallel(s: State, data: Data, count: int, column: int, other: int) -> bool:
    """Return whether two columns are parallel up to rounding once the included columns are projected out."""
    _span(s, data, count)
    first = _project_out(s.basis, count, data.columns[column])
    length = np.dot(first, first)
    if length <= DEPENDENT**2:
        return False
    second = _project_out(s.basis, count, data.columns[other])
    rest = second - np.dot(first, second) / length * first
    return bool(np.dot(rest, rest) <= DEPENDENT**2 * np.dot(second, second))


@inline
def _exclude_parallel(
    tableau: FloatArray, counters: IntArray, errors: FloatArray, s: State, data: Data, group: int
) -> None:
    """Exclude the columns that are parallel, in what is left of them, to that of a group.

    A subset with one of these columns explains no more than the same subset with the group, which the search covers.
    """
    own = _find_position(counters, data.first[group])
    for j in range(counters[FREE] - 1, -1, -1):
        column = counters[FIRST + j]
        near = tableau[j, j] * tableau[own, own] - tableau[j, own] ** 2 <= GONE * tableau[own, own]
        if j == own or not near or data.size[data.group[column]] > 1:
            continue
        if _is_parallel(s, data, counters[INCLUDED], data.first[group], column):
            _decide(tableau, counters, errors, s, data, data.group[column], _EXCLUDE)
            own = _find_position(counters, data.first[group])


@inline
def _backtrack(s: State, data: Data) -> None:
    """Take the exclude branch of the level above."""
    s.progress[LEVEL] -= 1
    level = s.progress[LEVEL]
    if level < 0:
        return
    tableau, counters, errors = s.sheets[level], s.numbers[level], s.errors[level]
    s.progress[LOGGED] = counters[MARK]
    group = counters[BRANCH]
    if data.size[group] == 1:
        _exclude_parallel(tableau, counters, errors, s, data, group)
    _decide(tableau, counters, errors, s, data, group, _EXCLUDE)


@_within
def _compute_threshold(best: float, factor: float, uncertainty: float) -> float:
    """Return the squared error above which a node is cut off."""
    target: float = best * factor
    return target + 2 * np.sqrt(target) * uncertainty


@_making_arrays
def _offer(s: State, data: Data, count: int, first: int, second: int) -> None:
    """Keep the included columns and two more if their squared error is the smallest.

    The error is computed by orthogonalisation; -1 stands for no column.
    """
    subset = np.full(data.group.size, -1, np.int64)
    _copy_vector(s.included[:count], subset[:count])
    _span(s, data, count)
    basis = np.empty((count + 2, data.chi.size))
    for k in range(count):
        _copy_vector(s.basis[k], basis[k])
    for column in (first, second):
        if column >= 0:
            subset[count] = column
            direction = _project_out(basis, count, data.columns[column])
            length = np.sqrt(np.dot(direction, direction))
            _copy_vector(
                direction / length if length > DEPENDENT else 0.0 * direction, basis[count]
            )
            count += 1
    left = _project_out(basis, count, data.chi)
    error = np.dot(left, left)
    if error < s.best[0] * (1 - 1e-12):
        s.best[0] = error
        _copy_vector(subset, s.subset)


@inline
def _reduce_node(
    tableau: FloatArray, counters: IntArray, errors: FloatArray, s: State, data: Data
) -> bool:
    """Decide what needs no branching at a node; False where it can be left.

    Groups that are explained already, or are too large for the columns left, are excluded. Groups without which the
    bound would exceed the threshold are included.
    """
    while True:
        threshold = _compute_threshold(s.best[0], data.factor, data.uncertainty)
        if errors[INSIDE] < threshold + data.slack:
            _offer(s, data, counters[INCLUDED], _NO_COLUMN, _NO_COLUMN)
            threshold = _compute_threshold(s.best[0], data.factor, data.uncertainty)
        slots = data.slots - counters[INCLUDED]
        if errors[BOUND] >= threshold or slots == 0 or counters[FREE] == 0:
            return False
        room = threshold - errors[BOUND]
        needed, must, useless = _count_mandatory(
            tableau, counters, data.group, data.size, slots, room
        )
        if useless >= 0:
            _decide(tableau, counters, errors, s, data, useless, _EXCLUDE)
        elif needed > slots:
            return False
        elif must < 0:
            return True
        else:
            _decide(tableau, counters, errors, s, data, must, _INCLUDE)


@_within
def _is_mandatory(tableau: FloatArray, nullity: int, j: int, room: float) -> bool:
    """Return whether the bound rises by at least ``room`` if a column is excluded."""
    own = tableau[tableau.shape[0] - 1, j]
    if own * own < room * tableau[tableau.shape[1] + j, j]:
        return False
    return _compute_null_fraction(tableau, nullity, j) <= APART


@inline
def _count_mandatory(
    tableau: FloatArray,
    counters: IntArray,
    group: IntArray,
    size: IntArray,
    columns_left: int,
    room: float,
) -> tuple[int, int, int]:
    """Return the columns of mandatory groups, one such group, and an excludable group; -1 for none."""
    needed, must, nullity = 0, _NO_COLUMN, counters[NULLITY]
    for j in range(counters[FREE]):
        own = group[counters[FIRST + j]]
        if size[own] > columns_left or (size[own] == 1 and tableau[j, j] <= GONE):
            return needed, must, own
        if counters[NEAR] == 0 and _is_mandatory(tableau, nullity, j, room):
            counted = False
            for i in range(j if size[own] > 1 else 0):
                same = group[counters[FIRST + i]] == own
                counted = counted or (same and _is_mandatory(tableau, nullity, i, room))
            if not counted:
                needed += size[own]
                must = own
    return needed, must, _NO_COLUMN


@inline
def _fill_last_place(
    tableau: FloatArray, counters: IntArray, inside: float, s: State, data: Data
) -> None:
    """Try every free column in the last place."""
    row = tableau.shape[0] - 2
    limit = _compute_threshold(s.best[0], data.factor, data.uncertainty) + data.slack
    for j in range(counters[FREE]):
        part = abs(tableau[row, j]) + ROUND_OFF
        if part * part > (inside - limit) * (tableau[j, j] - ROUND_OFF):
            _offer(s, data, counters[INCLUDED], counters[FIRST + j], _NO_COLUMN)
            limit = _compute_threshold(s.best[0], data.factor, data.uncertainty) + data.slack


@inline
def _fill_last_two_places(
    tableau: FloatArray, counters: IntArray, inside: float, s: State, data: Data
) -> None:
    """Try every pair of free columns, each of its own group, in the last two places."""
    moments, own = tableau[tableau.shape[0] - 2], s.spare
    limit = _compute_threshold(s.best[0], data.factor, data.uncertainty) + data.slack
    for i in range(counters[FREE]):
        own[i] = tableau[i, i]
        if not own[i] > GONE:  # its pairs are other columns alone
            continue
        step = moments[i] / own[i]
        left = inside - moments[i] * step
        if left < limit:  # every pair may be dependent
            _offer(s, data, counters[INCLUDED], counters[FIRST + i], _NO_COLUMN)
            limit = _compute_threshold(s.best[0], data.factor, data.uncertainty) + data.slack
        if _has_explaining(tableau[i, :i], own[:i], moments[:i], own[i], step, left - limit):
            for j in range(i):
                if _is_explaining(tableau[i, j], own[j], moments[j], own[i], step, left - limit):
                    _offer(s, data, counters[INCLUDED], counters[FIRST + i], counters[FIRST + j])
                    limit = (
                        _compute_threshold(s.best[0], data.factor, data.uncertainty) + data.slack
                    )


@_within
def _is_explaining(
    shared: float, column_errors: float, moment: float, beside: float, step: float, gap: float
) -> bool:
    """Return whether a column explains more than ``gap`` of what another column beside it leaves."""
    rest = column_errors - shared * shared / beside
    part = abs(moment - shared * step) + ROUND_OFF
    return bool((rest > GONE) & (part * part > gap * (rest - ROUND_OFF)))


@_within
def _has_explaining(
    shared: FloatArray,
    column_errors: FloatArray,
    moments: FloatArray,
    beside: float,
    step: float,
    gap: float,
) -> bool:
    """Return whether any of some columns explains more than ``gap``, which is rare; without branches, so that the loop
    is vectorised.
    """
    found = False
    for j in range(shared.size):
        found |= _is_explaining(shared[j], column_errors[j], moments[j], beside, step, gap)
    return found


@_within
def _choose_branching_column(tableau: FloatArray, counters: IntArray) -> int:
    """Return the free column to branch on: the column with the largest product of what including it explains and what
    excluding it costs the bound. By the latter alone an arm's searches take two thirds more nodes.
    """
    n, row = tableau.shape[1], tableau.shape[0] - 2
    best, chosen = -1.0, counters[FIRST]
    for j in range(counters[FREE]):
        own, inverse = tableau[j, j], tableau[n + j, j]
        if own > GONE and inverse > 0:  # round-off may leave none of it
            value = (tableau[row, j] * tableau[row + 1, j]) ** 2 / (own * inverse)
            if value > best:
                best, chosen = value, counters[FIRST + j]
    return int(chosen)


@inline
def _repeat(s: State, data: Data, log: IntArray) -> None:
    """Repeat the decisions that another search has logged."""
    for k in range(log.size):
        decision, level = log[k], s.progress[LEVEL]
        if decision == 0:
            _branch(s, data, log[k + 1] - 1)
        elif decision < 0 or k == 0 or log[k - 1] != 0:  # a branch has included its group already
            _decide(
                s.sheets[level], s.numbers[level], s.errors[level], s, data,
                abs(decision) - 1, decision > 0,
            )  # fmt: skip


@compile_loop(makes_arrays=False)
def search(s: State, data: Data, log: IntArray, most: int) -> tuple[int, int]:
    """Repeat the decisions that another search has logged, go on for a limited number of nodes, and stop with the log
    of where it is.

    This is the only function that Python calls, because each further one would be compiled together with all steps
    again.

    Returns:
        DONE or PAUSED, and the number of nodes visited.
    """
    _repeat(s, data, log)
    singles = data.size.size == data.group.size
    nodes = 0
    while True:
        if s.progress[GOING_BACK] == 1:
            _backtrack(s, data)
            s.progress[GOING_BACK] = 0
        level = s.progress[LEVEL]
        if level < 0:
            return DONE, nodes
        if nodes == most:
            return PAUSED, nodes
        nodes += 1
        tableau, counters, errors = s.sheets[level], s.numbers[level], s.errors[level]
        open_ = _reduce_node(tableau, counters, errors, s, data)
        slots = data.slots - counters[INCLUDED]
        if open_ and slots == 1:
            _fill_last_place(tableau, counters, errors[INSIDE], s, data)
            open_ = False
        elif open_ and slots == 2 and singles:
            _fill_last_two_places(tableau, counters, errors[INSIDE], s, data)
            open_ = False
        if open_:
            _branch(s, data, data.group[_choose_branching_column(tableau, counters)])
        else:
            s.progress[GOING_BACK] = 1
