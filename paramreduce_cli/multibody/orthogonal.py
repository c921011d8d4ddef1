"""Orthogonalisation of columns, and least squares."""

from math import sqrt

import numpy as np
import scipy.linalg

from paramreduce_cli.records import FloatArray, IntArray

DEPENDENT = 1e-9
"""A column is dependent on others when no more than this share of its length is left of it."""


class Orthogonaliser:
    """A set of unit columns and a vector, from which the components along chosen columns are removed.

    The method is modified Gram-Schmidt: a chosen column is orthogonalised once more, then its direction is removed from
    all others.

    Args:
        X: Columns of unit length or zero, (k, n).
        y: A vector that is taken along, (k,).
        dependent: Share of its length of which a column counts as dependent.
    """

    def __init__(
        self, X: FloatArray, y: FloatArray | None = None, dependent: float = DEPENDENT
    ) -> None:
        self.X: FloatArray = X.copy()
        """What is left of the columns; nothing of those that were taken or tried."""
        self.y: FloatArray = np.zeros(X.shape[0]) if y is None else y.copy()
        """What is left of the vector."""
        self._dependent = dependent
        self._basis = np.empty(X.shape[::-1])
        self._rank = 0

    def compute_squared_lengths(self) -> FloatArray:
        """Return the squared lengths of the columns after projection, zero for dependent ones, (n,)."""
        squared = np.einsum("ij,ij->j", self.X, self.X)
        squared[squared <= self._dependent**2] = 0.0
        return squared

    def take(self, column: int) -> bool:
        """Remove the direction of a column from all columns and from the vector, and set the column itself to zero.

        Return whether the column was independent of those taken before; if not, nothing else is changed.
        """
        direction = self.X[:, column].copy()
        self.X[:, column] = 0.0
        length = sqrt(direction @ direction)
        if not length > self._dependent:
            return False
        basis = self._basis[: self._rank]
        direction -= (basis @ direction) @ basis
        direction /= sqrt(direction @ direction)
        self.X -= direction[:, None] * (direction @ self.X)
        self.y -= direction * (direction @ self.y)
        self._basis[self._rank] = direction
        self._rank += 1
        return True

    def take_all(self, columns: IntArray) -> None:
        """Remove the directions of several columns, as :meth:`take` does one after the other, but in one go if nothing
        was taken before.
        """
        if self._rank == 0 and columns.size:
            Q, _, independent = orthogonalise(self.X[:, columns], self._dependent)
            self.X -= Q @ (Q.T @ self.X)
            self.X[:, columns] = 0.0
            self.y -= Q @ (Q.T @ self.y)
            self._rank = independent.size
            self._basis[: self._rank] = Q.T
            return
        for column in columns.tolist():
            self.take(column)


def orthogonalise(
    X: FloatArray, dependent: float = DEPENDENT
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return the orthogonal and triangular factors of the independent ones among unit columns, and these columns.

    Args:
        X: Columns of unit length or zero, (k, n).
        dependent: Share of its length of which a column counts as dependent.

    Returns:
        Q, (k, rank), and R, (rank, rank), with Q R = X[:, columns], and the columns, (rank,).
    """
    if X.shape[1] <= X.shape[0]:
        Q, R = np.linalg.qr(X)
        if np.abs(np.diag(R)).min(initial=np.inf) > dependent:
            return Q, R, np.arange(X.shape[1])
    Q, R, order = scipy.linalg.qr(X, mode="economic", pivoting=True)
    rank = int(np.sum(np.abs(np.diag(R)) > dependent))
    return Q[:, :rank], R[:rank, :rank], order[:rank]


def normalise_columns(W: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return columns divided by their lengths, (k, n), and the lengths, (n,), which are 1 for columns of zeros."""
    lengths = np.linalg.norm(W, axis=0)
    lengths = np.where(lengths > 0, lengths, 1.0)
    return W / lengths, lengths


def select_independent(
    W: FloatArray, preferred: IntArray, dependent: float = DEPENDENT
) -> list[int]:
    """Choose columns in order of preference; skip those that depend on columns chosen before.

    Args:
        W: Matrix, (k, n).
        preferred: Column indices, the most preferred first.
        dependent: Fraction of a column's length: a column depends on others if no more than this is left after
            projection.
    """
    rest = Orthogonaliser(normalise_columns(W[:, preferred])[0], dependent=dependent)
    return [int(column) for j, column in enumerate(preferred) if rest.take(j)]


def solve_least_squares(factor: FloatArray) -> FloatArray:
    """Return the parameters of smallest norm that fit best, (n,), from rows or a factor of [W | chi], (k, n + 1).

    Columns are scaled to unit length first, so that units do not matter.
    """
    X, lengths = normalise_columns(factor[:, :-1])
    solution: FloatArray = np.linalg.lstsq(X, factor[:, -1], rcond=DEPENDENT)[0] / lengths
    return solution
