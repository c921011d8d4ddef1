"""Selection as a config asks for it: columns and groups, effort, and the problem of an estimation set."""

import warnings

import numpy as np

from paramreduce_cli.config.schema import ReductionSection
from paramreduce_cli.errors import ConfigError, DataError, ParamreduceWarning
from paramreduce_cli.multibody.base_parameters import find_affecting_columns
from paramreduce_cli.records import BoolArray, FloatArray, Model, Run, Samples
from paramreduce_cli.reduction.grouping import Group, GroupedColumns, group_columns
from paramreduce_cli.reduction.problem import SelectionProblem
from paramreduce_cli.reduction.task import Effort


def make_columns(section: ReductionSection, samples: Samples) -> GroupedColumns:
    """Return the columns that the selection chooses among.

    Raises:
        ConfigError: The groups are those of subsystems, and there is no robot.
    """
    if section.groups == "auto":
        raise ConfigError(
            "is auto, which groups the uses of subsystems, and samples without a robot have none. Give groups, or leave it out.",
            ("reduction", "groups"),
        )
    groups = [
        Group(name, tuple(members), entry.tied)
        for entry in section.groups
        for name, members in entry.list_groups().items()
    ]
    return group_columns(samples.names, samples.preference, groups)


def make_effort(section: ReductionSection, run: Run) -> Effort:
    """Return the effort that the config asks for."""
    return Effort(
        time_limit=section.best_subset.time_limit,
        node_limit=section.best_subset.node_limit,
        subtrees=section.best_subset.parts == "subtrees",
        jobs=max(1, run.jobs),
    )


SIZES = (1e-100, 1e100)
"""Sizes of numbers whose squares a computer can hold."""


def _check_sizes(what: str, values: FloatArray) -> None:
    """Raise DataError if numbers are too large or too small to calculate with."""
    largest = float(np.abs(values).max())
    small, large = SIZES
    if np.isnan(largest) or largest > large or 0 < largest < small:
        raise DataError(
            f"the {what} of the estimation set: the largest number is {largest:.3g}, which is too "
            f"{'small' if largest < small else 'large'} to calculate with. Use SI units."
        )


_ROUND_OFF = 1e-15
"""Length of a column, relative to the longest, up to which its numbers are taken for round-off."""


def _compute_lengths(W: FloatArray) -> FloatArray:
    """Return the largest magnitude in each column, a measure of length that cannot overflow."""
    lengths: FloatArray = np.abs(W).max(axis=0)
    return lengths


def _find_affecting(W: FloatArray, values: FloatArray | None) -> BoolArray:
    """Return which columns have an effect, (n,): those that are not short, or that contribute to the torques if values
    are known.
    """
    affecting = find_affecting_columns(W)
    return affecting if values is None else affecting | find_affecting_columns(W * values)


def _warn_of_small_columns(W: FloatArray, affecting: BoolArray, names: tuple[str, ...]) -> None:
    """Warn about columns that count as zero because others are much longer."""
    lengths = _compute_lengths(W)
    small = np.flatnonzero((lengths > 0) & ~affecting)
    if small.size:
        largest = int(np.argmax(lengths))
        warnings.warn(
            f"{small.size} columns of the observation matrix count as zero beside {names[largest]}, "
            f"which is up to {lengths[largest] / lengths[small].min():.2g} times longer: "
            f"{', '.join(names[k] for k in small[:5])}{', ...' if small.size > 5 else ''}; give that "
            "parameter another unit, or the samples /parameters/values, if they matter",
            ParamreduceWarning,
            stacklevel=2,
        )


def make_problem(
    factor: FloatArray, model: Model | None, grouped: GroupedColumns, values: FloatArray | None
) -> SelectionProblem:
    """Return the least-squares problem behind a triangular factor of [W | chi].

    Args:
        factor: Triangular factor of the weighted [W | chi], (n + 1, n + 1).
        model: Model that says which parameters have an effect; without one the columns' lengths say that.
        grouped: Columns among which is chosen.
        values: Values of the standard parameters where these are known, (n_standard,).

    Raises:
        DataError: No column has an effect, or all torques are zero.
    """
    W, chi = factor[:, :-1], factor[:, -1]
    _check_sizes("observation matrix", W)
    if not np.any(chi):
        raise DataError("the torques of the estimation set are all zero: there is nothing to fit.")
    _check_sizes("torques", chi)
    certifiable = True
    if model is not None:
        affecting = model.affecting @ grouped.columns.expansion > 0
    else:
        known = values if not grouped.columns.tied else None
        affecting = _find_affecting(W, known)
        _warn_of_small_columns(W, affecting, grouped.columns.names)
        lengths = _compute_lengths(W)
        certifiable = not np.any(lengths[~affecting] > _ROUND_OFF * lengths.max())
    candidates = np.flatnonzero(affecting)
    if candidates.size == 0:
        raise DataError(
            "no column of the observation matrix differs from zero: there is nothing to select."
        )
    return SelectionProblem(W, chi, candidates, grouped.preference, grouped.groups, certifiable)
