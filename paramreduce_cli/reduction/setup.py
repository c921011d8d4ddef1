"""What a config asks of a selection: columns and groups, effort, and the problem of an estimation set."""

import numpy as np

from paramreduce_cli.config.schema import ReductionSection
from paramreduce_cli.errors import DataError
from paramreduce_cli.multibody.base_parameters import affecting_columns
from paramreduce_cli.records import FloatArray, Model, Run, Samples
from paramreduce_cli.reduction.grouping import Group, GroupedColumns, grouped_columns
from paramreduce_cli.reduction.problem import SelectionProblem
from paramreduce_cli.reduction.task import Effort


def selection_columns(wanted: ReductionSection, samples: Samples) -> GroupedColumns:
    """The columns among which is chosen."""
    groups = [
        Group(name, tuple(members), section.tied)
        for section in wanted.groups
        for name, members in section.groups().items()
    ]
    return grouped_columns(samples.names, samples.preference, groups)


def effort(wanted: ReductionSection, run: Run) -> Effort:
    """How hard the config asks to search."""
    return Effort(
        base_sets=wanted.backward_elimination.base_sets,
        continue_with_swaps=wanted.backward_elimination.swaps,
        kicks=wanted.swap.kicks,
        seed=wanted.swap.seed,
        time_limit=wanted.best_subset.time_limit,
        node_limit=wanted.best_subset.node_limit,
        jobs=run.jobs,
    )


def selection_problem(
    factor: FloatArray, model: Model | None, grouped: GroupedColumns
) -> SelectionProblem:
    """The least-squares problem behind a triangular factor of [W | chi].

    Raises:
        DataError: There is nothing to choose from, or nothing to explain.
    """
    W, chi = factor[:, :-1], factor[:, -1]
    if not np.isfinite(factor).all():
        raise DataError("the observation matrix holds numbers too large to calculate with.")
    if not np.any(chi):
        raise DataError("the torques of the estimation set are all zero: nothing to explain.")
    affecting = affecting_columns(W)
    if model is not None:
        affecting = model.affecting @ grouped.columns.expansion > 0
    candidates = np.flatnonzero(affecting)
    if candidates.size == 0:
        raise DataError("no column of the observation matrix differs from zero: nothing to choose.")
    return SelectionProblem(W, chi, candidates, grouped.preference, grouped.groups)
