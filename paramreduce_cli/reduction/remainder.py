"""Orthogonalisation of the candidates left over, shared by heuristics that build up a subset."""

from __future__ import annotations

import numpy as np

from paramreduce_cli.multibody.base_parameters import DEPENDENT
from paramreduce_cli.records import FloatArray, IntArray
from paramreduce_cli.reduction.problem import SelectionProblem


class Remainder:
    """What is left of the candidate columns and of chi once some columns are taken.

    Scores are per unit, a column or a group, those that are left in order of preference. Taking one removes its directions from all others by modified
    Gram-Schmidt, each new direction itself orthogonalised twice.
    """

    def __init__(self, problem: SelectionProblem) -> None:
        units = problem.units()
        self.units: IntArray = np.arange(len(units))
        """The units left, by their numbers in order of preference."""
        self.columns: IntArray = np.concatenate(units)
        self._sizes = np.array([unit.size for unit in units])
        self.X: FloatArray = problem.W[:, self.columns].copy()
        self.chi: FloatArray = problem.chi.copy()
        self.chi_length = float(np.linalg.norm(problem.chi))
        self._lengths = np.linalg.norm(self.X, axis=0)
        self._basis = np.empty((self.X.shape[0], 0))

    def squared_lengths(self) -> FloatArray:
        """Of what is left of each unit per column, zero where it is dependent, (n_units,)."""
        return self._per_unit(self._squared_lengths())

    def relative_squared_lengths(self) -> FloatArray:
        """The same relative to the whole columns."""
        whole = np.maximum(self._lengths, np.finfo(float).tiny) ** 2
        return self._per_unit(self._squared_lengths() / whole)

    def gains(self) -> FloatArray:
        """By how much each unit would lower the squared error, per column, (n_units,)."""
        squared = self._squared_lengths()
        gains = (self.chi @ self.X) ** 2
        scores = np.divide(gains, squared, out=np.full_like(gains, -1.0), where=squared > 0)
        if self._sizes.size == self.columns.size:
            return scores
        starts = self._starts()
        result = scores[starts]
        for unit in np.flatnonzero(self._sizes > 1):
            part = slice(starts[unit], starts[unit] + self._sizes[unit])
            alive = squared[part] > 0
            if alive.any():
                fitted = np.linalg.lstsq(self.X[:, part][:, alive], self.chi, rcond=DEPENDENT)[0]
                explained = self.X[:, part][:, alive] @ fitted
                result[unit] = explained @ explained / self._sizes[unit]
        return result

    def take(self, unit: int) -> None:
        """Add the columns of a unit, by its number, to the subset."""
        place = int(np.searchsorted(self.units, unit))
        start = int(self._starts()[place])
        for _ in range(int(self._sizes[place])):
            self._take_column(start)
        self._sizes = np.delete(self._sizes, place)
        self.units = np.delete(self.units, place)

    def _take_column(self, position: int) -> None:
        direction = self.X[:, position]
        dependent = np.linalg.norm(direction) <= DEPENDENT * self._lengths[position]
        self._drop(position)
        if dependent:
            return
        for _ in range(2):
            direction = direction - self._basis @ (self._basis.T @ direction)
            direction = direction / np.linalg.norm(direction)
        self.X -= np.outer(direction, direction @ self.X)
        self.chi -= direction * (direction @ self.chi)
        self._basis = np.column_stack([self._basis, direction])

    def _starts(self) -> IntArray:
        return np.concatenate([[0], np.cumsum(self._sizes)[:-1]]).astype(np.int64)

    def _per_unit(self, values: FloatArray) -> FloatArray:
        if self._sizes.size == self.columns.size:
            return values
        return np.add.reduceat(values, self._starts()) / self._sizes

    def _squared_lengths(self) -> FloatArray:
        squared = np.einsum("ij,ij->j", self.X, self.X)
        squared[squared <= (DEPENDENT * self._lengths) ** 2] = 0.0
        return squared

    def _drop(self, position: int) -> None:
        self.columns = np.delete(self.columns, position)
        self.X = np.delete(self.X, position, axis=1)
        self._lengths = np.delete(self._lengths, position)
