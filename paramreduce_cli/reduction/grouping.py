"""Parameters that play the same role on several bodies, as columns and groups of columns.

A tied group has one value for all its parameters: its columns of W add up to one. The
parameters of an untied group keep a value each, and are chosen or left out together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.records import FloatArray, IntArray


@dataclass(frozen=True)
class Group:
    """Names of parameters that belong together."""

    name: str
    members: tuple[str, ...]
    tied: bool


@dataclass(frozen=True)
class GroupedColumns:
    """The columns among which is chosen, and what they mean in standard parameters."""

    names: tuple[str, ...]
    expansion: FloatArray
    """Standard parameters from values of the columns, (n_standard, n_columns)."""
    groups: tuple[IntArray, ...]
    """Columns that are chosen together."""


def grouped_columns(names: Sequence[str], groups: Sequence[Group]) -> GroupedColumns:
    """Replace the columns of tied groups by one each, and find those of the others.

    Args:
        names: Of the standard parameters, (n_standard,).
        groups: With members among them, each in one group at most.
    """
    tied = {member: group for group in groups if group.tied for member in group.members}
    columns: list[tuple[str, list[int]]] = []
    for k, name in enumerate(names):
        group = tied.get(name)
        if group is None:
            columns.append((name, [k]))
        elif group.members[0] == name:
            columns.append((group.name, [names.index(member) for member in group.members]))
    labels = tuple(label for label, _ in columns)
    expansion = np.zeros((len(names), len(columns)))
    for j, (_, members) in enumerate(columns):
        expansion[members, j] = 1.0
    untied = (group for group in groups if not group.tied)
    return GroupedColumns(
        labels,
        expansion,
        tuple(np.array([labels.index(m) for m in g.members], dtype=np.int64) for g in untied),
    )
