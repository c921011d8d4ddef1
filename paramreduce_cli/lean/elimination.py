"""Solution of sparse linear systems whose entries are expressions, without row exchanges at run time.

The order of the pivots is chosen beforehand, on the matrices of some samples: the system falls into blocks that are
solved one after the other [Duff2017], and inside a block pivots are taken that make few new entries [Markowitz1957] and are
not small on any sample. Code that is made of the expressions has to check that its pivots are no smaller than these.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, maximum_bipartite_matching

from paramreduce_cli.lean.algebra import Scalar
from paramreduce_cli.records import BoolArray, FloatArray, IntArray

_THRESHOLD = 0.1
"""Smallest ratio of a pivot to the largest entry of its column, on all samples, that is as good as any other."""

Matrix = Sequence[Sequence[Scalar]]


@dataclass(frozen=True)
class Pivot:
    """An entry of the matrix that a column is eliminated with."""

    row: int
    column: int
    least: float
    """Smallest magnitude of the pivot on the samples."""


def choose_pivots(pattern: BoolArray, samples: FloatArray) -> list[list[Pivot]]:
    """Choose the pivots of each block, blocks in the order in which they can be solved.

    Args:
        pattern: Mask of the entries that are not always zero, (n, n).
        samples: Matrices of some samples, (n_samples, n, n), all regular.
    """
    return [_choose_in_block(pattern, samples, *block) for block in _find_blocks(pattern)]


def _find_blocks(pattern: BoolArray) -> list[tuple[IntArray, IntArray]]:
    """Return rows and columns of the smallest diagonal blocks, each after the blocks whose unknowns its rows contain."""
    column_of_row = maximum_bipartite_matching(csr_matrix(pattern), perm_type="column")
    needs = pattern[:, column_of_row]  # row i contains the unknown that row j determines
    count, block_of_row = connected_components(csr_matrix(needs), connection="strong")
    members = [np.flatnonzero(block_of_row == k) for k in range(count)]
    waiting = {
        k: set(block_of_row[needs[rows].any(axis=0)].tolist()) - {k}
        for k, rows in enumerate(members)
    }
    order: list[int] = []
    while waiting:
        ready = next(k for k, needed in waiting.items() if needed <= set(order))
        order.append(ready)
        del waiting[ready]
    return [(members[k], column_of_row[members[k]]) for k in order]


def _choose_in_block(
    pattern: BoolArray, samples: FloatArray, rows: IntArray, columns: IntArray
) -> list[Pivot]:
    """Return the pivots of a block in the order of elimination."""
    values, filled = samples[:, rows][:, :, columns].copy(), pattern[np.ix_(rows, columns)].copy()
    left_rows, left_columns = np.arange(rows.size), np.arange(rows.size)
    pivots: list[Pivot] = []
    while left_rows.size:
        some = np.ix_(left_rows, left_columns)
        sizes, there = np.abs(values[:, some[0], some[1]]), filled[some]
        largest = np.maximum(sizes.max(axis=1, keepdims=True), np.finfo(float).tiny)
        ratios = np.where(there, (sizes / largest).min(axis=0), 0.0)
        new_entries = (there.sum(axis=1, keepdims=True) - 1) * (
            there.sum(axis=0, keepdims=True) - 1
        )
        good = ratios >= min(_THRESHOLD, ratios.max())
        cost = np.where(good & there, new_entries - ratios, np.inf)
        at = np.unravel_index(np.argmin(cost), cost.shape)
        i, j = left_rows[at[0]], left_columns[at[1]]
        pivots.append(Pivot(int(rows[i]), int(columns[j]), float(sizes[:, at[0], at[1]].min())))
        left_rows, left_columns = left_rows[left_rows != i], left_columns[left_columns != j]
        for r in left_rows[filled[left_rows, j]]:
            factor = values[:, r, j] / values[:, i, j]
            values[:, r] -= factor[:, None] * values[:, i]
            filled[r] |= filled[i]
    return pivots


class Elimination:
    """The elimination of a square matrix of expressions, with which systems are solved.

    Args:
        matrix: Rows of the matrix, (n, n).
        blocks: Pivots of each block, as :func:`choose_pivots` returns them.
    """

    def __init__(self, matrix: Matrix, blocks: Sequence[Sequence[Pivot]]) -> None:
        self._blocks = blocks
        self._entries = [list(row) for row in matrix]
        self._inverse: dict[int, Scalar] = {}
        """Reciprocals of the pivots by column."""
        self._factors: dict[tuple[int, int], Scalar] = {}
        """Factors by which a pivot's row is subtracted from another row, by that row and the pivot's column."""
        self.pivots: list[Scalar] = []
        """The pivots, block by block in the order of elimination, (n,)."""
        for block in blocks:
            self._eliminate(block)

    def _eliminate(self, block: Sequence[Pivot]) -> None:
        """Eliminate the columns of a block from its rows."""
        entries = self._entries
        for k, (i, j) in enumerate((pivot.row, pivot.column) for pivot in block):
            self.pivots.append(entries[i][j])
            self._inverse[j] = entries[i][j].invert()
            for below in block[k + 1 :]:
                if not entries[below.row][j]:
                    continue
                factor = self._factors[below.row, j] = entries[below.row][j] * self._inverse[j]
                for after in block[k + 1 :]:
                    product = factor * entries[i][after.column]
                    entries[below.row][after.column] = entries[below.row][after.column] - product

    def solve(self, right: Sequence[Scalar]) -> list[Scalar]:
        """Return the solution for one right side, (n,) each."""
        rest, solution = list(right), list(right)
        solved: list[int] = []
        for block in self._blocks:
            for pivot in block:
                for column in solved:
                    rest[pivot.row] = (
                        rest[pivot.row] - self._entries[pivot.row][column] * solution[column]
                    )
            for k, pivot in enumerate(block):
                for below in block[k + 1 :]:
                    if (below.row, pivot.column) in self._factors:
                        factor = self._factors[below.row, pivot.column]
                        rest[below.row] = rest[below.row] - factor * rest[pivot.row]
            for k, pivot in reversed(list(enumerate(block))):
                value = rest[pivot.row]
                for after in block[k + 1 :]:
                    value = value - self._entries[pivot.row][after.column] * solution[after.column]
                solution[pivot.column] = value * self._inverse[pivot.column]
            solved += [pivot.column for pivot in block]
        return solution
