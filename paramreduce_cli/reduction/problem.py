"""The selection problem that every heuristic works on, and rules that heuristics share."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from paramreduce_cli.multibody.orthogonal import normalise_columns
from paramreduce_cli.records import FloatArray, IntArray

FULL_PRECISION = 1e-13
"""Share of the torques below which what is left to explain is round-off of the selection."""
TIE = 1e-9
"""Relative difference below which two scores are equal."""


@dataclass(frozen=True)
class SelectionProblem:
    """A least-squares problem W phi = chi, weighted and compressed to a triangular factor.

    Attributes:
        W: Triangular factor of the observation matrix, (k, n).
        chi: Torques, transformed like W, (k,).
        candidates: Columns that may be chosen, in ascending order.
        preference: All columns, the most wanted first; it breaks every tie.
        joined: Sets of several columns that are kept or dropped together; every other column is a group alone.
        certifiable: Whether round-off leaves no doubt about which columns have an effect.
    """

    W: FloatArray
    chi: FloatArray
    candidates: IntArray
    preference: IntArray
    joined: tuple[IntArray, ...] = ()
    certifiable: bool = True

    def replace_data(self, factor: FloatArray) -> SelectionProblem:
        """Return the same selection on other data, given as a triangular factor of [W | chi]."""
        W, chi = factor[:, :-1], factor[:, -1]
        return replace(self, W=W, chi=chi)

    @property
    def candidates_by_preference(self) -> IntArray:
        """Candidates, the most preferred first."""
        return self.preference[np.isin(self.preference, self.candidates)]

    @cached_property
    def groups(self) -> list[IntArray]:
        """Groups of columns that are kept or dropped together, most of one column, the most preferred first.

        A group has the position of its most preferred member; its members are in order of preference.
        """
        owner = {int(column): k for k, group in enumerate(self.joined) for column in group}
        found: dict[int, list[int]] = {}
        for column in self.candidates_by_preference.tolist():
            found.setdefault(owner.get(column, -1 - column), []).append(column)
        return [np.array(columns, dtype=np.int64) for columns in found.values()]

    @cached_property
    def columns(self) -> IntArray:
        """Columns of all groups, one group after the other, (n_candidates,)."""
        return np.concatenate([np.zeros(0, np.int64), *self.groups])

    @cached_property
    def _normalised(self) -> tuple[FloatArray, FloatArray]:
        return normalise_columns(self.W)

    @property
    def X(self) -> FloatArray:
        """W with columns of unit length, (k, n)."""
        return self._normalised[0]

    @property
    def lengths(self) -> FloatArray:
        """Lengths of the columns of W, one for columns of zeros, (n,)."""
        return self._normalised[1]

    @cached_property
    def y(self) -> FloatArray:
        """Chi with unit length: errors against it are shares of the torques, (k,)."""
        return self.chi / (np.linalg.norm(self.chi) or 1.0)


def find_first_best(scores: FloatArray) -> int:
    """Return the position of the first score that is the largest up to rounding.

    Scores are in order of preference, so this breaks ties.
    """
    best = scores.max()
    return int(np.argmax(scores >= best - TIE * abs(best)))
