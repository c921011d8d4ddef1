"""The selection problem every heuristic works on, and the rules they share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from paramreduce_cli.records import FloatArray, IntArray

FULL_PRECISION = 1e-13
"""Share of the torques below which what is left to explain is round-off."""
TIE = 1e-9
"""Relative difference below which two scores are equal."""


@dataclass(frozen=True)
class SelectionProblem:
    """Least squares W phi = chi, weighted and compressed to a triangular factor.

    Attributes:
        W: (k, n)
        chi: (k,)
        candidates: Columns that may be chosen, in ascending order.
        preference: All columns, the most wanted first; it breaks every tie.
        groups: Sets of columns that are chosen or left out together; all others stand alone.
    """

    W: FloatArray
    chi: FloatArray
    candidates: IntArray
    preference: IntArray
    groups: tuple[IntArray, ...] = ()

    @property
    def candidates_by_preference(self) -> IntArray:
        """The candidates, the most wanted first."""
        return self.preference[np.isin(self.preference, self.candidates)]

    def units(self) -> list[IntArray]:
        """What is chosen as one, candidates alone or in groups, the most wanted first.

        A group stands where its most wanted member does, its members in order of preference.
        """
        owner = {int(column): k for k, group in enumerate(self.groups) for column in group}
        found: dict[int, list[int]] = {}
        for column in self.candidates_by_preference.tolist():
            found.setdefault(owner.get(column, -1 - column), []).append(column)
        return [np.array(columns, dtype=np.int64) for columns in found.values()]


def first_of_the_best(scores: FloatArray) -> int:
    """Position of the first score that is the largest up to rounding.

    Scores come in order of preference, so this is where ties are broken.
    """
    best = float(np.max(scores))
    return int(np.argmax(scores >= best - TIE * abs(best)))
