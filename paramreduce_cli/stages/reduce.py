"""reduce: select parameters with each heuristic, and prove how good that is."""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from paramreduce_cli import registry
from paramreduce_cli.config import Config
from paramreduce_cli.config.schema import ReductionSection, Stop
from paramreduce_cli.errors import ConfigError, DataError, ParamreduceWarning
from paramreduce_cli.multibody.base_parameters import (
    independent_columns,
)
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.observation import (
    combined_factor,
    standard_deviation,
    thinned_blocks,
)
from paramreduce_cli.records import (
    FloatArray,
    IntArray,
    Model,
    Proofs,
    Reduction,
    Run,
    Samples,
    Subsets,
)
from paramreduce_cli.reduction.acceleration_objective import AccelerationData
from paramreduce_cli.reduction.fitting import Fit, NormErrors, torque_errors
from paramreduce_cli.reduction.grouping import GroupedColumns
from paramreduce_cli.reduction.objective import Means, Objective
from paramreduce_cli.reduction.task import Task
from paramreduce_cli.reduction.task import run as run_heuristic
from paramreduce_cli.registry import stage
from paramreduce_cli.stages.counting import Counts
from paramreduce_cli.stages.problem import (
    effort,
    merged_factor,
    selection_problem,
    tied_columns,
)


@stage
def reduce(
    config: Config | None,
    model: Model | None,
    samples: Samples,
    previous: Reduction | None,
    run: Run,
) -> Reduction:
    """Select parameters with each heuristic, for every number of them.

    Works on any samples.h5, also one that a user brings: without a model all columns that
    are not zero take part. Ctrl-C ends the search for proofs, and what is proven is kept; the
    same command goes on from there.
    """
    wanted = config.reduction if config is not None else ReductionSection()
    if model is not None and model.mechanism.parameter_names != tuple(samples.names):
        raise DataError(
            "the samples have other parameters than the model: they are of another robot. Bring "
            "samples of this one, or give no CONFIG."
        )
    weights = _weights(wanted, samples)
    columns = tied_columns(wanted, samples.names)
    factor = merged_factor(combined_factor(samples.estimation.factors(), weights), columns)
    problem = selection_problem(factor, model, columns)
    rows = samples.estimation.n_samples * weights.size
    if rows < problem.candidates.size:
        raise DataError(
            f"{rows} rows are too few for {problem.candidates.size} parameters; bring more samples."
        )
    rank = len(independent_columns(problem.W, problem.candidates_by_preference))
    _remark_on_rank(rank, model, columns)
    if previous is not None and not np.array_equal(previous.factor, factor):
        previous = None
    means = _Means(config, model, samples, columns)
    objectives: dict[str, Objective] = {}
    found, proofs = {}, None
    for name in wanted.heuristics:
        criterion = name.partition("@")[2] or "torque"
        if criterion not in objectives:
            objectives[criterion] = registry.selection_criterion[criterion](problem, means)
        task = _task(objectives[criterion], wanted, previous, run)
        found[name], made = _selected(task, name, wanted.stop)
        proofs = made if made is not None else proofs
    _remark_on_proofs(proofs)
    heuristics = _with_norms(found, samples, columns, weights)
    return Reduction(columns.names, columns.expansion, weights, rank, factor, heuristics, proofs)


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


def _remark_on_rank(rank: int, model: Model | None, columns: GroupedColumns) -> None:
    tied = len(columns.names) < columns.expansion.shape[0]
    if model is not None and not tied and rank < model.base.columns.size:
        warnings.warn(
            f"the estimation set excites only {rank} of the {model.base.columns.size} base "
            "parameters; the others cannot be told apart on it",
            ParamreduceWarning,
            stacklevel=2,
        )


class _Means(Means):
    """What criteria ask for, made from the stage's inputs when they do."""

    def __init__(
        self, config: Config | None, model: Model | None, samples: Samples, columns: GroupedColumns
    ) -> None:
        section = config.reduction if config is not None else ReductionSection()
        self.error_limit = section.operations.torque_error
        self._config, self._model = config, model
        self._samples, self._columns = samples, columns

    def _modelled(self, criterion: str) -> tuple[Config, Model]:
        if self._config is None or self._model is None:
            raise DataError(f"the criterion {criterion} needs a model; give a CONFIG.")
        return self._config, self._model

    @cached_property
    def _dynamics(self) -> Dynamics:
        return Dynamics(self._modelled("of the heuristics")[1].mechanism)

    @cached_property
    def _counts(self) -> Counts:
        return Counts(*self._modelled("operations"))

    def accelerations(self, most: int) -> AccelerationData:
        """Samples spread evenly over the estimation set."""
        self._modelled("acceleration")
        nominal = self._samples.nominal_acceleration
        if nominal is None:
            raise DataError("samples.h5 holds no /nominal_acceleration; accelerations need it.")
        every = max(1, -(-self._samples.estimation.n_samples // most))
        blocks = list(thinned_blocks(self._samples.estimation.blocks(), every))
        q, dq, ddz, tau = (
            np.concatenate([getattr(block, key) for block in blocks])
            for key in ("q", "dq", "ddz", "tau")
        )
        A, B = self._dynamics.direct_regressor(q, dq)
        expansion = self._columns.expansion
        return AccelerationData(A @ expansion, B @ expansion, tau, ddz, nominal)

    def cost(self, kept: IntArray) -> int:
        """Operations of the lean inverse dynamics, nearly."""
        return self._counts.estimate(self._columns.expansion[:, kept])


def _remark_on_proofs(proofs: Proofs | None) -> None:
    """Say what is not proven."""
    if proofs is None or set(proofs.status) == {"optimal"}:
        return
    counts = {status: proofs.status.count(status) for status in dict.fromkeys(proofs.status)}
    text = f"best-subset: {counts.get('optimal', 0)} of {proofs.n.size} sizes are proven"
    if "best-found" in counts:
        text += (
            f", {counts['best-found']} are the best found so far, with lower bounds; `paramreduce "
            "reduce` goes on with them"
        )
    if "uncertified" in counts:
        text += (
            f", {counts['uncertified']} cannot be certified in double precision, because columns "
            "are nearly dependent"
        )
    warnings.warn(text, ParamreduceWarning, stacklevel=2)


@dataclass(frozen=True)
class _Selected:
    """What a heuristic found: subsets and their fits."""

    subsets: tuple[IntArray, ...]
    fits: list[Fit]
    seconds: float


def _task(
    objective: Objective, wanted: ReductionSection, previous: Reduction | None, run: Run
) -> Task:
    return Task(
        objective=objective,
        largest=wanted.stop.parameters,
        effort=effort(wanted, run),
        previous=previous.proofs if previous is not None else None,
        progress=run.progress,
        interrupted=run.interrupted,
    )


def _selected(task: Task, name: str, stop: Stop) -> tuple[_Selected, Proofs | None]:
    started = time.perf_counter()
    found = run_heuristic(name, task)
    seconds = time.perf_counter() - started
    if not found.subsets:
        smallest = int(task.objective.widths.min())
        raise ConfigError(
            f"reduction.stop.parameters is {stop.parameters}, but with groups the smallest subset "
            f"has {smallest} parameters. Raise it."
        )
    fits = [task.objective.fit(subset) for subset in found.subsets]
    kept = _kept(fits, stop)
    return _Selected(found.subsets[:kept], fits[:kept], seconds), found.proofs


def _kept(fits: list[Fit], stop: Stop) -> int:
    """How many subsets a limit of the error leaves."""
    if stop.torque_error is None:
        return len(fits)
    good = (k for k, f in enumerate(fits, 1) if f.torque_error <= stop.torque_error)
    return next(good, len(fits))


def _with_norms(
    found: dict[str, _Selected], samples: Samples, columns: GroupedColumns, weights: FloatArray
) -> dict[str, Subsets]:
    """One pass over the samples for the 1- and infinity norms of all models together."""
    models = [
        columns.expansion[:, subset] @ f.parameters
        for entry in found.values()
        for subset, f in zip(entry.subsets, entry.fits, strict=True)
    ]
    errors = torque_errors(samples.estimation.blocks(), np.column_stack(models), weights)
    heuristics = {}
    start = 0
    for name, entry in found.items():
        part = slice(start, start + len(entry.subsets))
        heuristics[name] = _subsets(name, entry, errors, part)
        start = part.stop
    return heuristics


def _subsets(name: str, found: _Selected, errors: NormErrors, part: slice) -> Subsets:
    return Subsets(
        heuristic=name,
        subsets=found.subsets,
        n=np.array([subset.size for subset in found.subsets]),
        torque_error=np.array([f.torque_error for f in found.fits]),
        torque_error_1=errors.one[part],
        torque_error_inf=errors.infinity[part],
        parameters=tuple(f.parameters for f in found.fits),
        beta=tuple(f.beta for f in found.fits),
        minimum_norm=np.array([f.minimum_norm for f in found.fits]),
        seconds=found.seconds,
    )
