"""Orthogonalisation of the candidates left over, shared by heuristics that build up a subset."""

from __future__ import annotations

import numpy as np

from paramreduce_cli.multibody.base_parameters import DEPENDENT
from paramreduce_cli.records import FloatArray, IntArray
from paramreduce_cli.reduction.problem import SelectionProblem


class Remainder:
    """What is left of the candidate columns and of chi once some columns are taken.

    Columns stand in order of preference. Taking one removes its direction from all others by
    modified Gram-Schmidt, the new direction itself orthogonalised twice.
    """

    def __init__(self, problem: SelectionProblem) -> None:
        self.columns: IntArray = problem.candidates_by_preference
        self.X: FloatArray = problem.W[:, self.columns].copy()
        self.chi: FloatArray = problem.chi.copy()
        self.chi_length = float(np.linalg.norm(problem.chi))
        self._lengths = np.linalg.norm(self.X, axis=0)
        self._basis = np.empty((self.X.shape[0], 0))
        self.order: list[int] = []

    def squared_lengths(self) -> FloatArray:
        """Of what is left of each column, zero where it is dependent, (n_left,)."""
        squared = np.einsum("ij,ij->j", self.X, self.X)
        squared[squared <= (DEPENDENT * self._lengths) ** 2] = 0.0
        return squared

    def relative_squared_lengths(self) -> FloatArray:
        """The same relative to the whole columns."""
        return self.squared_lengths() / np.maximum(self._lengths, np.finfo(float).tiny) ** 2

    def take(self, position: int) -> None:
        """Add the column at a position to the subset."""
        direction = self.X[:, position]
        for _ in range(2):
            direction = direction - self._basis @ (self._basis.T @ direction)
            direction = direction / np.linalg.norm(direction)
        self.order.append(int(self.columns[position]))
        self._drop(position)
        self.X -= np.outer(direction, direction @ self.X)
        self.chi -= direction * (direction @ self.chi)
        self._basis = np.column_stack([self._basis, direction])

    def take_the_rest(self) -> IntArray:
        """Append all that is left, in order of preference, and return the whole order."""
        return np.array([*self.order, *self.columns.tolist()], dtype=np.int64)

    def _drop(self, position: int) -> None:
        self.columns = np.delete(self.columns, position)
        self.X = np.delete(self.X, position, axis=1)
        self._lengths = np.delete(self._lengths, position)
