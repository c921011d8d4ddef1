"""reduce: order the parameters by each heuristic."""

from __future__ import annotations

import time
import warnings

import numpy as np

from paramreduce_cli import registry
from paramreduce_cli.config import Config
from paramreduce_cli.config.schema import ReductionSection, Stop
from paramreduce_cli.errors import DataError, ParamreduceWarning
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
from paramreduce_cli.reduction.fitting import Fit, NormErrors, fit, model_column, torque_errors
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
    factor = combined_factor(samples.estimation.factors(), weights)
    problem = _problem(factor, samples.estimation.n_samples * weights.size, model, samples)
    rank = len(independent_columns(problem.W, problem.candidates_by_preference))
    _remark_on_rank(rank, model)
    found = {name: _ordered(problem, name, wanted.stop) for name in wanted.heuristics}
    orderings = _with_norms(found, samples, weights)
    return Reduction(samples.names, weights, rank, factor, orderings)


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
    factor: FloatArray, rows: int, model: Model | None, samples: Samples
) -> SelectionProblem:
    W, chi = factor[:, :-1], factor[:, -1]
    if not np.isfinite(factor).all():
        raise DataError("the observation matrix holds numbers too large to calculate with.")
    if not np.any(chi):
        raise DataError("the torques of the estimation set are all zero: nothing to explain.")
    affecting = affecting_columns(W) if model is None else model.affecting
    candidates = np.flatnonzero(affecting)
    if candidates.size == 0:
        raise DataError("no column of the observation matrix differs from zero: nothing to choose.")
    if rows < candidates.size:
        raise DataError(
            f"{rows} rows are too few for {candidates.size} parameters; bring more samples."
        )
    return SelectionProblem(W, chi, candidates, preference_order(samples.names))


def _remark_on_rank(rank: int, model: Model | None) -> None:
    if model is not None and rank < model.base.columns.size:
        warnings.warn(
            f"the estimation set excites only {rank} of the {model.base.columns.size} base "
            "parameters; the others cannot be told apart on it",
            ParamreduceWarning,
            stacklevel=2,
        )


def _ordered(problem: SelectionProblem, name: str, stop: Stop) -> tuple[IntArray, list[Fit], float]:
    started = time.perf_counter()
    order = registry.heuristic[name](problem)
    seconds = time.perf_counter() - started
    fits = [fit(problem, order[:n]) for n in range(1, order.size + 1)]
    kept = _kept(fits, stop)
    return order[:kept], fits[:kept], seconds


def _kept(fits: list[Fit], stop: Stop) -> int:
    """How many parameters the stopping rule leaves: the smaller of its two limits."""
    limits = [len(fits)]
    if stop.parameters is not None:
        limits.append(stop.parameters)
    if stop.torque_error is not None:
        good = (n for n, f in enumerate(fits, 1) if f.torque_error <= stop.torque_error)
        limits.append(next(good, len(fits)))
    return min(limits)


def _with_norms(
    found: dict[str, tuple[IntArray, list[Fit], float]], samples: Samples, weights: FloatArray
) -> dict[str, Ordering]:
    """One pass over the samples for the 1- and infinity norms of all models together."""
    columns = [
        model_column(order[: n + 1], f.parameters, len(samples.names))
        for order, fits, _ in found.values()
        for n, f in enumerate(fits)
    ]
    errors = torque_errors(samples.estimation.blocks(), np.column_stack(columns), weights)
    orderings = {}
    start = 0
    for name, (order, fits, seconds) in found.items():
        part = slice(start, start + order.size)
        orderings[name] = _ordering(name, order, fits, errors, part, seconds)
        start += order.size
    return orderings


def _ordering(
    name: str, order: IntArray, fits: list[Fit], errors: NormErrors, part: slice, seconds: float
) -> Ordering:
    return Ordering(
        heuristic=name,
        order=order,
        torque_error=np.array([f.torque_error for f in fits]),
        torque_error_1=errors.one[part],
        torque_error_inf=errors.infinity[part],
        parameters=tuple(f.parameters for f in fits),
        beta=tuple(f.beta for f in fits),
        minimum_norm=np.array([f.minimum_norm for f in fits]),
        seconds=seconds,
    )
