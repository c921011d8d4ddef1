"""The stage reduce: parameters selected by each heuristic, and proofs of the best subsets."""

import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import NoReturn

import numpy as np

from paramreduce_cli.config.schema import ReductionSection, Stop
from paramreduce_cli.errors import ConfigError, DataError, ParamreduceWarning
from paramreduce_cli.judgement.acceleration_errors import split_prescribed
from paramreduce_cli.judgement.torque_errors import NormErrors, compute_torque_errors
from paramreduce_cli.lean.counting import Counts
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.noise import estimate_joint_noise
from paramreduce_cli.multibody.observation import (
    combine_factors,
    compute_standard_deviation,
    decimate_blocks,
)
from paramreduce_cli.multibody.orthogonal import select_independent
from paramreduce_cli.records import (
    PROVING,
    Columns,
    CountedDynamics,
    FloatArray,
    IntArray,
    Items,
    Model,
    PartFinished,
    Progress,
    Proofs,
    ProofStatus,
    Reduction,
    Run,
    Samples,
    SelectionMethod,
    Subsets,
)
from paramreduce_cli.reduction.best_subset.kept_proofs import KeptProofs
from paramreduce_cli.reduction.criteria import criteria
from paramreduce_cli.reduction.fitting import Fit
from paramreduce_cli.reduction.grouping import merge_factor
from paramreduce_cli.reduction.inputs import AccelerationData, CriterionInputs
from paramreduce_cli.reduction.objective import Objective
from paramreduce_cli.reduction.setup import SIZES, make_columns, make_effort, make_problem
from paramreduce_cli.reduction.task import SelectionTask
from paramreduce_cli.reduction.task import run as run_heuristic


def reduce(
    reduction: ReductionSection,
    counted: CountedDynamics,
    model: Model | None,
    samples: Samples,
    previous: Reduction | None,
    run: Run,
    items: Items,
) -> Reduction:
    """Select parameters with each heuristic, for every number of them.

    The samples may be user-supplied; without a model the selection uses all columns that are not zero.
    Ctrl-C ends the search for proofs and keeps those found so far; the same command continues from there.
    The items are the proofs of the sizes; jobs may also divide the search of each size.

    Raises:
        DataError: The samples are of another robot, or too few.
    """
    if model is not None and model.mechanism.parameter_names != tuple(samples.names):
        raise DataError(
            "the samples have other parameters than the model: they belong to another robot. Use samples of this robot, or leave out CONFIG."
        )
    weights = _choose_weights(reduction, samples)
    grouped = make_columns(reduction, samples)
    columns = grouped.columns
    factor = merge_factor(combine_factors(samples.estimation.compute_factors(), weights), columns)
    problem = make_problem(factor, model, grouped, samples.values)
    rows = samples.estimation.n_samples * weights.size
    if rows < problem.candidates.size:
        raise DataError(
            f"{rows} rows are too few for {problem.candidates.size} parameters; use more samples."
        )
    rank = len(select_independent(problem.W, problem.candidates_by_preference))
    _warn_of_rank(rank, model, columns)
    kept = KeptProofs(items, factor, by_subtrees=reduction.best_subset.parts == "subtrees")
    most = len(problem.columns)
    sizes = range(1, min(reduction.stop.parameters or most, most) + 1)
    if not items.part.is_whole:
        _check_proves(reduction.heuristics)
        if kept.is_finished(sizes):
            raise PartFinished
    same = previous is not None and np.array_equal(previous.factor, factor)
    proven = kept.load(previous.proofs if previous is not None and same else None)
    inputs = _make_criterion_inputs(reduction, counted, model, samples, columns)
    if not items.part.is_whole:
        objective = criteria[SelectionMethod.criterion](problem, inputs)
        _prove_part(_make_task(objective, reduction, proven, items, kept, run), kept, sizes)
    tasks: dict[str, SelectionTask] = {}
    found: dict[str, _Selected] = {}
    proofs = None
    names = reduction.heuristics
    for k, name in enumerate(names):
        run.progress(Progress("heuristics", k, len(names), name))
        method = SelectionMethod.parse(name)
        if method.criterion not in tasks:
            objective = criteria[method.criterion](problem, inputs)
            tasks[method.criterion] = _make_task(objective, reduction, proven, items, kept, run)
        found[name], made = _run_heuristic(tasks[method.criterion], method, reduction.stop)
        proofs = made if made is not None else proofs
    run.progress(Progress("heuristics", len(names), len(names)))
    _warn_of_open_proofs(proofs)
    heuristics = _add_norms(found, samples, columns, weights)
    return Reduction(columns, weights, rank, factor, heuristics, proofs)


def _check_proves(heuristics: Sequence[str]) -> None:
    """Raise ConfigError unless best subsets are proven, as all else takes seconds."""
    if PROVING not in heuristics:
        raise ConfigError(
            f"has no {PROVING}, and --part divides proofs only. Remove --part.",
            ("reduction", "heuristics"),
        )


def _prove_part(task: SelectionTask, kept: KeptProofs, sizes: Sequence[int]) -> NoReturn:
    """Search for this job's part of the proofs, and store what is proven.

    Args:
        task: Criterion, effort and callbacks.
        kept: Proofs among the items, which are added to.
        sizes: Numbers of parameters that are searched.

    Raises:
        PartFinished: The search has ended.
    """
    cut_short: list[bool] = []

    def note_interruption() -> None:
        """Note the interruption, and that the search is cut short."""
        task.interrupted()
        cut_short.append(True)

    proofs = run_heuristic(PROVING, replace(task, interrupted=note_interruption)).proofs
    assert proofs is not None
    kept.keep(proofs, sizes, cut_short=bool(cut_short))
    raise PartFinished


def _choose_weights(section: ReductionSection, samples: Samples) -> FloatArray:
    """Return the divisor of each joint's errors, (n_dof,).

    Raises:
        DataError: A divisor is zero, no number, or too small or too large to calculate with.
    """
    weights = samples.nominal_torque
    if section.weighting == "none":
        n_dof = next(iter(samples.estimation.iterate_blocks())).tau.shape[1]
        return np.where(np.isinf(weights), np.inf, 1.0) if weights is not None else np.ones(n_dof)
    if weights is None:
        weights = compute_standard_deviation(
            block.tau for block in samples.estimation.iterate_blocks()
        )
    if section.weighting == "noise":
        found = samples.estimation
        weights = estimate_joint_noise(found.compute_factors(), weights, found.n_samples)
    small, large = SIZES
    good = (weights > small) & (weights < large) | np.isinf(weights)
    if not good.all():
        raise DataError(
            f"joint {int(np.argmin(good)) + 1} has no torque to weigh its errors by, or one too "
            "small or too large to calculate with. Use SI units, or give nominal_torque, in N m (N "
            "for a prismatic joint)."
        )
    return weights


def _warn_of_rank(rank: int, model: Model | None, columns: Columns) -> None:
    if model is not None and not columns.tied and rank < model.base.columns.size:
        warnings.warn(
            f"the estimation set excites only {rank} of the {model.base.columns.size} base "
            "parameters; the data do not determine the others",
            ParamreduceWarning,
            stacklevel=2,
        )


def _make_criterion_inputs(
    section: ReductionSection,
    counted: CountedDynamics,
    model: Model | None,
    samples: Samples,
    columns: Columns,
) -> CriterionInputs:
    """Return the inputs of criteria, which are computed when a criterion asks for them.

    Asking raises DataError if a needed model or nominal accelerations are missing.
    """

    def require_model(criterion: str) -> Model:
        """Return the model; raise DataError if there is none."""
        if model is None:
            raise DataError(f"the criterion {criterion} needs a model; give a CONFIG.")
        return model

    @cache
    def counts() -> Counts:
        return Counts(require_model("operations"), counted)

    @cache
    def dynamics() -> Dynamics:
        return Dynamics(require_model("acceleration").mechanism)

    def accelerations(most: int) -> AccelerationData:
        """Samples spread evenly over the estimation set."""
        direct = dynamics().compute_mass_matrix_and_bias
        nominal = samples.nominal_acceleration
        if nominal is None:
            raise DataError("samples.h5 holds no /nominal_acceleration; accelerations need it.")
        every = max(1, -(-samples.estimation.n_samples // most))
        blocks = list(decimate_blocks(samples.estimation.iterate_blocks(), every))
        q, dq, ddz, tau = (
            np.concatenate([getattr(block, key) for block in blocks])
            for key in ("q", "dq", "ddz", "tau")
        )
        A, B = direct(q, dq, columns.expansion)
        free, held = split_prescribed(nominal)
        B = B + np.einsum("sijp,sj->sip", A[:, :, held], ddz[:, held])
        A = A[:, free][:, :, free]
        return AccelerationData(A, B[:, free], tau[:, free], ddz[:, free], nominal[free])

    def cost(kept: IntArray) -> int:
        """Operations of the lean inverse dynamics, nearly."""
        return counts().estimate(np.isin(columns.column, kept))

    return CriterionInputs(section.operations.torque_error, accelerations, cost)


def _warn_of_open_proofs(proofs: Proofs | None) -> None:
    """Warn about sizes whose best subset is not proven."""
    if proofs is None or proofs.n_proven == proofs.n_provable:
        return
    counts = {status: proofs.status.count(status) for status in ProofStatus}
    text = f"best-subset: {proofs.n_proven} of {proofs.n_provable} sizes are proven"
    if counts[ProofStatus.BEST_FOUND]:
        text += (
            f", {counts[ProofStatus.BEST_FOUND]} are the best found so far, with lower bounds; `paramreduce "
            "reduce` goes on with them"
        )
    if counts[ProofStatus.UNCERTIFIED]:
        text += (
            f", {counts[ProofStatus.UNCERTIFIED]} cannot be certified in double precision, because columns "
            "are nearly dependent or differ too much in size"
        )
    warnings.warn(text, ParamreduceWarning, stacklevel=2)


@dataclass(frozen=True)
class _Selected:
    """The subsets of a heuristic with their fits."""

    subsets: tuple[IntArray, ...]
    fits: list[Fit]
    seconds: float


def _make_task(
    objective: Objective,
    section: ReductionSection,
    proven: Proofs | None,
    items: Items,
    kept: KeptProofs,
    run: Run,
) -> SelectionTask:
    """Return the task that every heuristic of a criterion gets."""
    return SelectionTask(
        objective=objective,
        largest=section.stop.parameters,
        effort=make_effort(section, run),
        previous=proven,
        part=items.part,
        incumbents={} if items.part.is_whole else items.kept,
        keep=kept.keep_size,
        progress=run.progress,
        interrupted=run.interrupted,
    )


def _run_heuristic(
    task: SelectionTask, method: SelectionMethod, stop: Stop
) -> tuple[_Selected, Proofs | None]:
    """Return the subsets and fits of a heuristic, and its proofs; None for the proofs of heuristics that make none.

    Raises:
        ConfigError: With groups no subset is as small as the config asks for.
    """
    started = time.perf_counter()
    found = run_heuristic(method.heuristic, task)
    seconds = time.perf_counter() - started
    if not found.subsets:
        smallest = int(task.objective.widths.min())
        raise ConfigError(
            f"is {stop.parameters}, but with groups the smallest subset has {smallest} parameters. Raise "
            "it.",
            ("reduction", "stop", "parameters"),
        )
    fits = [task.objective.fit(subset) for subset in found.subsets]
    kept = _count_kept(fits, stop)
    return _Selected(found.subsets[:kept], fits[:kept], seconds), found.proofs


def _count_kept(fits: list[Fit], stop: Stop) -> int:
    """Return the number of subsets up to the first within the limit of the error."""
    if stop.torque_error is None:
        return len(fits)
    good = (k for k, f in enumerate(fits, 1) if f.torque_error <= stop.torque_error)
    return next(good, len(fits))


def _add_norms(
    selected: dict[str, _Selected], samples: Samples, columns: Columns, weights: FloatArray
) -> dict[str, Subsets]:
    """Return the subsets with the 1- and infinity norms of their errors, from one pass over the samples."""
    models = [
        columns.make_model(subset, f.parameters).standard
        for entry in selected.values()
        for subset, f in zip(entry.subsets, entry.fits, strict=True)
    ]
    errors = compute_torque_errors(
        samples.estimation.iterate_blocks(), np.column_stack(models), weights
    )
    heuristics = {}
    start = 0
    for name, entry in selected.items():
        part = slice(start, start + len(entry.subsets))
        heuristics[name] = _make_subsets(name, entry, errors, part)
        start = part.stop
    return heuristics


def _make_subsets(name: str, selected: _Selected, errors: NormErrors, part: slice) -> Subsets:
    return Subsets(
        heuristic=name,
        subsets=selected.subsets,
        n=np.array([subset.size for subset in selected.subsets]),
        torque_error=np.array([f.torque_error for f in selected.fits]),
        torque_error_1=errors.one[part],
        torque_error_inf=errors.infinity[part],
        parameters=tuple(f.parameters for f in selected.fits),
        minimum_norm=np.array([f.minimum_norm for f in selected.fits]),
        seconds=selected.seconds,
    )
