"""Subsets of parameters, the proofs of their optimality, and the reduced models that they make."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from enum import StrEnum
from functools import cached_property
from typing import ClassVar

import numpy as np

from paramreduce_cli.records.arrays import BoolArray, FloatArray, IntArray
from paramreduce_cli.records.choices import Choices
from paramreduce_cli.records.parameters import Parameter
from paramreduce_cli.records.representation import record

PROVING = "best-subset"
"""The heuristic that proves."""
NOT_KEPT = -1
"""Position of a standard parameter that a reduced model does without."""


@record
class SelectionMethod:
    """A heuristic and the criterion it selects by, written ``HEURISTIC`` or ``HEURISTIC@CRITERION``."""

    heuristic: str
    criterion: str = "torque"

    @classmethod
    def parse(cls, text: str) -> SelectionMethod:
        """Read what :meth:`__str__` writes; whether the names are known is not looked at."""
        heuristic, _, criterion = text.partition("@")
        return cls(heuristic, criterion or cls.criterion)

    @property
    def by_torque(self) -> bool:
        """Whether the criterion is the torque error."""
        return self.criterion == SelectionMethod.criterion

    def __str__(self) -> str:
        return self.heuristic if self.by_torque else f"{self.heuristic}@{self.criterion}"


@record
class ReducedModel:
    """A model that keeps some values: which standard parameter has which of them.

    The full model, the base parameters and every subset have this form.
    """

    names: tuple[str, ...]
    """Names of the values, (n,)."""
    values: FloatArray
    """Approximate base parameters, (n,), SI unless there are units."""
    position: IntArray
    """Position of each standard parameter's value, :data:`NOT_KEPT` for none, (n_standard,)."""
    expressions: tuple[str, ...] = ()
    """Sum of standard parameters that each value is of; empty if not requested."""
    units: FloatArray | None = None
    """Sizes of the units of the values where these are not SI, (n,)."""

    @property
    def n(self) -> int:
        """Number of values."""
        return self.values.size

    @cached_property
    def kept(self) -> IntArray:
        """Standard parameters that have a value, ascending."""
        return np.flatnonzero(self.position != NOT_KEPT)

    @property
    def first(self) -> list[int]:
        """Number of the first standard parameter that has each value; the value has its unit and kind, (n,)."""
        return [int(np.flatnonzero(self.position == k)[0]) for k in range(self.n)]

    @property
    def unit_sizes(self) -> FloatArray:
        """Sizes of the units of the values, SI, (n,)."""
        return np.ones(self.n) if self.units is None else self.units

    def list_units(self, parameters: Sequence[Parameter]) -> list[str]:
        """Return the units of the values, such as ``kg m`` or ``(0.0825 kg m)``.

        Args:
            parameters: The standard parameters.
        """
        names = (parameters[k].unit for k in self.first)
        return [
            name if size == 1.0 else f"({size:.9g} {name})"
            for name, size in zip(names, self.unit_sizes, strict=True)
        ]

    @property
    def standard(self) -> FloatArray:
        """Values of the standard parameters, SI, zero where none is kept, (n_standard,)."""
        result = np.zeros(self.position.size)
        result[self.kept] = (self.values * self.unit_sizes)[self.position[self.kept]]
        return result

    @property
    def ties(self) -> dict[int, int]:
        """For every parameter but the first of those with the same value, that first one."""
        first: dict[int, int] = {}
        for parameter in self.kept.tolist():
            first.setdefault(int(self.position[parameter]), parameter)
        owners = {
            parameter: first[int(self.position[parameter])] for parameter in self.kept.tolist()
        }
        return {parameter: owner for parameter, owner in owners.items() if parameter != owner}

    def drop_unaffecting(self, affecting: BoolArray) -> ReducedModel:
        """Return the model without parameters that change no torque."""
        return replace(self, position=np.where(affecting, self.position, NOT_KEPT))


@record
class Columns:
    """The columns that a selection chooses among: standard parameters, or several that share one value."""

    names: tuple[str, ...]
    """Names of the columns, (n,)."""
    column: IntArray
    """Column that each standard parameter belongs to, (n_standard,)."""

    @property
    def tied(self) -> bool:
        """Whether a column stands for several parameters."""
        return len(self.names) < self.column.size

    @cached_property
    def expansion(self) -> FloatArray:
        """Standard parameters from values of the columns, ones and zeros, (n_standard, n)."""
        return (self.column[:, None] == np.arange(len(self.names))).astype(float)

    def make_model(self, subset: IntArray, values: FloatArray) -> ReducedModel:
        """Return the model that keeps a subset of the columns, (n_kept,), with their values."""
        position = np.full(len(self.names), NOT_KEPT)
        position[subset] = np.arange(subset.size)
        return ReducedModel(tuple(self.names[k] for k in subset), values, position[self.column])


@record
class BySize:
    """A record of arrays with one row for every size of subset."""

    n: IntArray
    """Sizes of the subsets: 1, 2, ... unless columns are chosen in groups, (m,)."""

    def find_row(self, n: int) -> int | None:
        """Return the row of the subset of size n, or None if there is none."""
        rows = np.flatnonzero(self.n == n)
        return int(rows[0]) if rows.size else None


@record
class Subsets(BySize):
    """The subsets of parameters that one heuristic has found, one for every size."""

    heuristic: str
    subsets: tuple[IntArray, ...]
    """Column indices of each subset, in the order in which they were taken; (n,) each."""
    torque_error: FloatArray
    """Weighted Euclidean error on the estimation set of each subset, (m,)."""
    torque_error_1: FloatArray
    """The same in the 1-norm, (m,)."""
    torque_error_inf: FloatArray
    """The same in the infinity norm, (m,)."""
    parameters: tuple[FloatArray, ...]
    """Approximate base parameters of each subset, in its order; (n,) each."""
    minimum_norm: BoolArray
    """Mask of subsets beyond the rank, which are fitted with minimum norm, (m,)."""
    seconds: float

    def get_subset(self, n: int) -> IntArray:
        """Return the columns of the subset of size n, (n,).

        Raises:
            KeyError: There is no subset of this size.
        """
        row = self.find_row(n)
        if row is None:
            raise KeyError(n)
        return self.subsets[row]

    @property
    def order(self) -> IntArray | None:
        """Column indices, the first n of which are the subset of size n; None if not nested."""
        longest = self.subsets[-1]
        nested = all(np.array_equal(s, longest[: s.size]) for s in self.subsets)
        return longest if nested else None


class ProofStatus(StrEnum):
    """A statement on the best subset of a size."""

    OPTIMAL = "optimal"
    BEST_FOUND = "best-found"
    """The search has not ended: there is a lower bound."""
    UNCERTIFIED = "uncertified"
    """Double precision is not enough for a proof."""
    BEYOND_RANK = "beyond-rank"
    """The size exceeds the rank of the columns: the error is that of all columns together."""


@record
class Proofs(BySize):
    """The proofs of the best subset of at most each size; arrays have one row per size."""

    units: tuple[IntArray, ...]
    """Groups of columns that were kept or dropped together, most of one column, the most preferred first."""
    subsets: tuple[IntArray, ...]
    """Column indices of the best subset found of at most each size."""
    torque_error: FloatArray
    """Torque error of the best known subsets, (m,)."""
    lower_bound: FloatArray
    """Torque error that no subset of the size is below, (m,)."""
    status: tuple[ProofStatus, ...]
    seconds: FloatArray
    """Time spent on each size in all runs, (m,)."""
    nodes: IntArray
    """Nodes of the search tree that were visited, (m,)."""
    logs: tuple[IntArray, ...]
    """State of each unfinished search, to continue from."""
    dealt: IntArray
    """Digest of the subtrees that a search was dealt as among several jobs, 0 where it was not, (m,)."""

    def get_size(self, n: int) -> Proofs:
        """Return the proof of one size alone.

        Raises:
            KeyError: There is no proof of this size.
        """
        row = self.find_row(n)
        if row is None:
            raise KeyError(n)
        arrays = (
            "subsets",
            "torque_error",
            "lower_bound",
            "status",
            "seconds",
            "nodes",
            "logs",
            "dealt",
        )
        rows = {name: getattr(self, name)[row : row + 1] for name in ("n", *arrays)}
        return replace(self, **rows)

    @property
    def n_proven(self) -> int:
        """Number of sizes whose best subset is proven."""
        return self.status.count(ProofStatus.OPTIMAL)

    @property
    def n_provable(self) -> int:
        """Number of sizes up to the rank of the columns."""
        return self.n.size - self.status.count(ProofStatus.BEYOND_RANK)


@record
class ProofItem:
    """An item of proofs: the sizes that one job has proven, and the data on which the proofs hold."""

    factor: FloatArray
    """Triangular factor of the weighted [W | chi] of the estimation set, (n + 1, n + 1)."""
    proofs: Proofs


@record
class Reduction:
    """The subsets of all heuristics on one estimation set."""

    FILE: ClassVar[str] = "reduction.h5"
    columns: Columns
    nominal_torque: FloatArray
    rank: int
    factor: FloatArray
    """Triangular factor of the weighted [W | chi] of the estimation set, (n + 1, n + 1)."""
    heuristics: Mapping[str, Subsets]
    """Heuristics by the text of their :class:`SelectionMethod`."""
    proofs: Proofs | None
    """Proofs of the best subsets by torque, where they were looked for."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "heuristics", Choices(self.heuristics))

    @property
    def n_affecting(self) -> int:
        """Columns of the observation matrix that are not zero."""
        return int(self.factor[:, :-1].any(axis=0).sum())

    @property
    def unfinished(self) -> bool:
        """Whether more time could prove more."""
        return self.proofs is not None and ProofStatus.BEST_FOUND in self.proofs.status

    def make_model(self, heuristic: str, row: int) -> ReducedModel:
        """Return the model of a heuristic's subset in some row, with its parameters in the order of the columns."""
        found = self.heuristics[heuristic]
        order = np.argsort(found.subsets[row])
        return self.columns.make_model(found.subsets[row][order], found.parameters[row][order])


@record
class ModelChoice:
    """A model of a reduction, written ``HEURISTIC:N``."""

    heuristic: str
    n: int

    @classmethod
    def parse(cls, text: str) -> ModelChoice:
        """Read the text; a size that is no number is none that there is."""
        heuristic, _, number = text.partition(":")
        return cls(heuristic, int(number) if number.isdecimal() else NOT_KEPT)

    def find_row(self, reduction: Reduction) -> int | None:
        """Return the row of the model among its heuristic's subsets, or None if there is no such model."""
        found = reduction.heuristics.get(self.heuristic)
        return None if found is None else found.find_row(self.n)
