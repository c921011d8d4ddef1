"""Groups of parameters that play the same role on several bodies, as columns and groups of columns.

A tied group has one value for all its parameters: its columns of W add up to one. The parameters of an untied group are
only selected together.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.records import LAST, Columns, FloatArray, IntArray, order_by_preference


@dataclass(frozen=True)
class Group:
    """A group of parameters by name."""

    name: str
    members: tuple[str, ...]
    tied: bool


@dataclass(frozen=True)
class GroupedColumns:
    """The columns to select from, their order of preference, and which of them belong together."""

    columns: Columns
    preference: IntArray
    """Columns from the most to the least wanted, (n,)."""
    groups: tuple[IntArray, ...]
    """Columns that are chosen together."""


def group_columns(names: Sequence[str], ranks: IntArray, groups: Sequence[Group]) -> GroupedColumns:
    """Replace the columns of each tied group by one, and find those of the other groups.

    Args:
        names: Names of the standard parameters, (n_standard,).
        ranks: Ranks of preference, (n_standard,). A tied group has the rank of its members if they agree, otherwise it
            comes last.
        groups: Groups with members among these names; no name is in two groups.
    """
    tied = {member: group for group in groups if group.tied for member in group.members}
    labels = list(dict.fromkeys(tied[n].name if n in tied else n for n in names))
    column = np.array([labels.index(tied[n].name if n in tied else n) for n in names])
    ranked = []
    for k in range(len(labels)):
        own = set(ranks[column == k].tolist())
        ranked.append(own.pop() if len(own) == 1 else LAST)
    together = tuple(
        np.array([labels.index(member) for member in group.members], dtype=np.int64)
        for group in groups
        if not group.tied
    )
    return GroupedColumns(Columns(tuple(labels), column), order_by_preference(ranked), together)


def merge_factor(factor: FloatArray, columns: Columns) -> FloatArray:
    """Return the triangular factor of [W T | chi], where T adds up the columns of tied groups."""
    if not columns.tied:
        return factor
    added = np.column_stack([factor[:, :-1] @ columns.expansion, factor[:, -1]])
    merged: FloatArray = np.linalg.qr(added, mode="r")  # type: ignore[assignment]
    return merged
