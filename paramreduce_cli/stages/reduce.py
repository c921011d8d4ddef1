"""reduce: order the parameters by each heuristic."""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass

import numpy as np

from paramreduce_cli import registry
from paramreduce_cli.config import Config
from paramreduce_cli.config.schema import ReductionSection, Stop
from paramreduce_cli.errors import ConfigError, DataError, ParamreduceWarning
from paramreduce_cli.multibody.base_parameters import (
    affecting_columns,
    independent_columns,
    preference_order,
)
from paramreduce_cli.multibody.observation import combined_factor, standard_deviation
from paramreduce_cli.records import (
    FloatArray,
    IntArray,
    Model,
    Ordering,
    Reduction,
    Samples,
)
from paramreduce_cli.reduction.fitting import Fit, NormErrors, fit, torque_errors
from paramreduce_cli.reduction.grouping import Group, GroupedColumns, grouped_columns
from paramreduce_cli.reduction.problem import SelectionProblem
from paramreduce_cli.registry import stage


@stage
def reduce(config: Config | None, model: Model | None, samples: Samples) -> Reduction:
    """Order the parameters with each heuristic and fit every subset.

    Works on any samples.h5, also one that a user brings: without a model all columns that
    are not zero take part.
    """
    wanted = config.reduction if config is not None else ReductionSection()
    if model is not None and model.mechanism.parameter_names != tuple(samples.names):
        raise DataError(
            "the samples have other parameters than the model: they are of another robot. Bring "
            "samples of this one, or give no CONFIG."
        )
    weights = _weights(wanted, samples)
    columns = grouped_columns(samples.names, _groups(wanted))
    factor = _merged(combined_factor(samples.estimation.factors(), weights), columns)
    problem = _problem(factor, samples.estimation.n_samples * weights.size, model, columns)
    rank = len(independent_columns(problem.W, problem.candidates_by_preference))
    _remark_on_rank(rank, model, columns)
    found = {name: _ordered(problem, name, wanted.stop) for name in wanted.heuristics}
    orderings = _with_norms(found, samples, columns, weights)
    return Reduction(columns.names, columns.expansion, weights, rank, factor, orderings)


def _groups(wanted: ReductionSection) -> list[Group]:
    return [
        Group(name, tuple(members), section.tied)
        for section in wanted.groups
        for name, members in section.groups().items()
    ]


def _merged(factor: FloatArray, columns: GroupedColumns) -> FloatArray:
    """The triangular factor of [W T | chi], T adding up the columns of tied groups."""
    if len(columns.names) == columns.expansion.shape[0]:
        return factor
    merged: FloatArray = np.linalg.qr(
        np.column_stack([factor[:, :-1] @ columns.expansion, factor[:, -1]]), mode="r"
    )  # type: ignore[assignment]
    return merged


def _weights(wanted: ReductionSection, samples: Samples) -> FloatArray:
    if wanted.weighting == "none":
        return np.ones(next(iter(samples.estimation.blocks())).tau.shape[1])
    if samples.nominal_torque is not None:
        weights = samples.nominal_torque
    else:
        weights = standard_deviation(block.tau for block in samples.estimation.blocks())
    if not np.all(weights > 0):
        raise DataError(
            f"joint {int(np.argmin(weights)) + 1} has no torque to weigh its errors by. Give "
            "nominal_torque, in N m (N for a prismatic joint)."
        )
    return weights


def _problem(
    factor: FloatArray, rows: int, model: Model | None, columns: GroupedColumns
) -> SelectionProblem:
    W, chi = factor[:, :-1], factor[:, -1]
    if not np.isfinite(factor).all():
        raise DataError("the observation matrix holds numbers too large to calculate with.")
    if not np.any(chi):
        raise DataError("the torques of the estimation set are all zero: nothing to explain.")
    affecting = affecting_columns(W)
    if model is not None:
        affecting = model.affecting @ columns.expansion > 0
    candidates = np.flatnonzero(affecting)
    if candidates.size == 0:
        raise DataError("no column of the observation matrix differs from zero: nothing to choose.")
    if rows < candidates.size:
        raise DataError(
            f"{rows} rows are too few for {candidates.size} parameters; bring more samples."
        )
    preference = preference_order(columns.names)
    return SelectionProblem(W, chi, candidates, preference, columns.groups)


def _remark_on_rank(rank: int, model: Model | None, columns: GroupedColumns) -> None:
    tied = len(columns.names) < columns.expansion.shape[0]
    if model is not None and not tied and rank < model.base.columns.size:
        warnings.warn(
            f"the estimation set excites only {rank} of the {model.base.columns.size} base "
            "parameters; the others cannot be told apart on it",
            ParamreduceWarning,
            stacklevel=2,
        )


@dataclass(frozen=True)
class _Found:
    """What a heuristic found: an order and the fits of its subsets."""

    order: IntArray
    n: IntArray
    fits: list[Fit]
    seconds: float


def _ordered(problem: SelectionProblem, name: str, stop: Stop) -> _Found:
    started = time.perf_counter()
    order = registry.heuristic[name](problem)
    seconds = time.perf_counter() - started
    sizes = problem.sizes(order)
    fits = [fit(problem, order[:n]) for n in sizes]
    kept = _kept(sizes, fits, stop)
    return _Found(order[: sizes[kept - 1]], sizes[:kept], fits[:kept], seconds)


def _kept(sizes: IntArray, fits: list[Fit], stop: Stop) -> int:
    """How many subsets the stopping rule leaves: the smaller of its two limits."""
    kept = len(fits)
    if stop.parameters is not None:
        kept = min(kept, int(np.sum(sizes <= stop.parameters)))
        if kept == 0:
            raise ConfigError(
                f"reduction.stop.parameters is {stop.parameters}, but with groups the smallest subset "
                f"has {sizes[0]} parameters. Raise it."
            )
    if stop.torque_error is not None:
        good = (k for k, f in enumerate(fits, 1) if f.torque_error <= stop.torque_error)
        kept = min(kept, next(good, len(fits)))
    return kept


def _with_norms(
    found: dict[str, _Found], samples: Samples, columns: GroupedColumns, weights: FloatArray
) -> dict[str, Ordering]:
    """One pass over the samples for the 1- and infinity norms of all models together."""
    models = [
        columns.expansion[:, entry.order[:n]] @ f.parameters
        for entry in found.values()
        for n, f in zip(entry.n, entry.fits, strict=True)
    ]
    errors = torque_errors(samples.estimation.blocks(), np.column_stack(models), weights)
    orderings = {}
    start = 0
    for name, entry in found.items():
        part = slice(start, start + entry.n.size)
        orderings[name] = _ordering(name, entry, errors, part)
        start += entry.n.size
    return orderings


def _ordering(name: str, found: _Found, errors: NormErrors, part: slice) -> Ordering:
    return Ordering(
        heuristic=name,
        order=found.order,
        n=found.n,
        torque_error=np.array([f.torque_error for f in found.fits]),
        torque_error_1=errors.one[part],
        torque_error_inf=errors.infinity[part],
        parameters=tuple(f.parameters for f in found.fits),
        beta=tuple(f.beta for f in found.fits),
        minimum_norm=np.array([f.minimum_norm for f in found.fits]),
        seconds=found.seconds,
    )
