"""The stage reduce-terms: functions of reduced models with negligible terms removed."""

import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from paramreduce_cli.config.schema import SamplingSection, TrajectoriesSection
from paramreduce_cli.config.term_settings import TermsSection
from paramreduce_cli.errors import ConfigError, ParamreduceWarning
from paramreduce_cli.lean.formulations import add_formulations
from paramreduce_cli.lean.lean_models import LeanModels
from paramreduce_cli.records import (
    CountedDynamics,
    Items,
    Model,
    ModelErrors,
    Progress,
    Reduction,
    Run,
    Samples,
    SetErrors,
    TermFront,
    TermModel,
    TermReduction,
)
from paramreduce_cli.resources.item_completion import complete_items
from paramreduce_cli.terms.descent import Simplified
from paramreduce_cli.terms.evaluation import Errors, Evaluator
from paramreduce_cli.terms.leanest_program import simplify
from paramreduce_cli.terms.parallel_descents import Searcher, SearchSamples
from paramreduce_cli.terms.program_fitting import Budget
from paramreduce_cli.terms.starts import list_starts
from paramreduce_cli.texts import format_percent

_FIRST, _CLOSELY = (300, 200), (1000, 500)
"""Samples of the estimation and the validation set that are looked at while terms are left out, at first and
in the end."""
_MARGIN = 0.8
"""Share of the budget that the sets which are looked at may take, as errors on other motions are larger: docs/lab/terms.md."""
_POSES = 300
"""States at which mass matrices are looked at meanwhile."""
_PARTS = 4
"""Parts of a log's training part, which are fitted to and watched by turns."""
_SMALLEST = 2
"""Starts for which formulations are searched, the smallest ones."""
_FITTED = 1000
"""Samples of the estimation set to which the parameters of what is left are fitted."""


def reduce_terms(
    section: TermsSection | None,
    trajectories: TrajectoriesSection,
    sampling: SamplingSection,
    counted: CountedDynamics,
    model: Model,
    samples: Samples,
    reduction: Reduction,
    run: Run,
    items: Items,
) -> TermReduction:
    """Prune negligible terms of the functions of reduced models, and fit the rest.

    Parameters are fitted to the estimation set. If the full model gave the torques, errors stay within 80 % of the
    budget on the estimation and the validation set, so that they are probably within the budget on the test set, which
    the search does not use. If torques were measured, errors stay within the budget on the training part. A function
    without any program within the budget is left out, with a warning. The items are the functions.
    """
    if section is None:
        raise ConfigError(
            "is missing: it says which errors are allowed, such as `terms: {torque_error: 0.01}`.",
            ("terms",),
        )
    allowed = Budget(section.torque_error, section.acceleration_error or np.inf)
    budget = allowed if sampling.measured else allowed.scale(_MARGIN)
    names = list(dict.fromkeys(section.functions))
    task = _Task(section, budget, trajectories, sampling, counted, model, samples, reduction, run)
    found = complete_items(run, items, names, lambda: task, _search, task="functions")
    functions = {name: one for name, one in found.items() if one is not None}
    allowance = (
        "it"
        if sampling.measured
        else f"{format_percent(_MARGIN)} of it, which leaves room for other motions,"
    )
    _warn_of_missing([name for name in names if name not in functions], bool(functions), allowance)
    alone = sampling.measured or samples.validation is None
    return TermReduction(allowed.torque, allowed.acceleration, alone, functions)


@dataclass(frozen=True)
class _Task:
    """The budget, samples and starts that the searches of all functions share."""

    section: TermsSection
    budget: Budget
    trajectories: TrajectoriesSection
    sampling: SamplingSection
    counted: CountedDynamics
    model: Model
    samples: Samples
    reduction: Reduction
    run: Run


def _search(task: _Task, name: str) -> TermModel | None:
    """Prune the terms of a function; return None if nothing is found within the budget."""
    section, budget, trajectories = task.section, task.budget, task.trajectories
    sampling, samples, run = task.sampling, task.samples, task.run
    model, reduction = task.model, task.reduction
    projected = model.mechanism.loops is not None and task.counted is CountedDynamics.INDEPENDENT
    lean = LeanModels(model, independent=projected)
    direct = name == "direct"
    starts = list_starts(budget.torque, lean, model, reduction, direct=direct)
    smallest = [start.model.kept for start in starts[:_SMALLEST]]
    suited = replace(
        model, formulations=add_formulations(model, smallest, direct=direct, jobs=run.jobs)
    )
    lean = LeanModels(suited, independent=projected)
    mechanism = model.mechanism
    judge = Evaluator(
        model, samples, reduction.nominal_torque,
        trajectories.build_limits(mechanism.n_dof), trajectories.build_constraints(mechanism),
        direct=direct, projected=projected, measured=sampling.measured,
    )  # fmt: skip

    def progress(fraction: float, detail: str) -> None:
        run.progress(Progress(f"terms of the {name} dynamics", fraction, 1.0, detail))

    searcher = Searcher(
        lean, _choose_samples(judge, samples, *_FIRST), _choose_samples(judge, samples, *_CLOSELY),
        judge.sample_poses(_POSES), budget, direct,
    )  # fmt: skip
    found = simplify(
        searcher, starts, max_rounds=section.rounds, seconds=section.time_limit or np.inf,
        jobs=run.jobs, progress=progress,
    )  # fmt: skip
    if found.cut_short:
        _warn_of_time_limit(name)
    fitted = judge.decimate(samples.estimation, _FITTED)
    evaluated = [
        EvaluatedProgram.judge(one.refit(fitted, budget), judge, budget) for one in found.front
    ]
    ends = (one.refit(fitted, budget) for one in found.ends)
    records = (
        _make_record(one, judge, evaluated, lean)
        for one in _iterate_within_budget(ends, judge, budget)
    )
    term = next((record for record in records if record is not None), None)
    if term is not None and not np.isfinite(budget.acceleration):
        _warn_of_accelerations(term)
    return term


@dataclass(frozen=True)
class EvaluatedProgram:
    """A program with its errors on both sets."""

    program: Simplified
    errors: tuple[Errors, Errors]
    worst_ratio: float
    """Largest ratio of an error to its budget."""

    @classmethod
    def judge(cls, program: Simplified, judge: Evaluator, budget: Budget) -> "EvaluatedProgram":
        """Return a program with its errors."""
        errors = judge.compute_errors(program)
        return cls(program, errors, judge.compute_worst_ratio(errors, budget))

    @property
    def rank(self) -> tuple[int, float]:
        """Operations, then the worst ratio to the budget; less is better."""
        return self.program.program.n_operations, self.worst_ratio


def _iterate_within_budget(
    ends: Iterable[Simplified], judge: Evaluator, budget: Budget
) -> Iterator[EvaluatedProgram]:
    """Yield the programs within the budget, the leanest first; among equals the most exact first.

    Args:
        ends: Programs, the leanest first; they are judged when they are asked for.
        judge: Judges them.
        budget: Budget of errors.
    """
    for _, alike in groupby(ends, lambda one: one.program.n_operations):
        judged = sorted(
            (EvaluatedProgram.judge(one, judge, budget) for one in alike),
            key=lambda one: one.worst_ratio,
        )
        yield from (one for one in judged if one.worst_ratio <= 1)


def _choose_samples(
    judge: Evaluator, samples: Samples, searched: int, watched: int
) -> SearchSamples:
    """Return the samples for fitting parameters and for watching errors during the search.

    If torques are measured, both sets are quarters of the training part in turn, because one motion says little about
    another.
    """
    if judge.measured:
        some = judge.decimate(samples.estimation, searched + watched)
        count = some.states.shape[1]
        fitted = np.arange(count) * _PARTS // count % 2 == 0
        return SearchSamples(some.select(fitted), some.select(~fitted))
    fitted_to = judge.decimate(samples.estimation, searched)
    if samples.validation is None:
        return SearchSamples(fitted_to, None)
    return SearchSamples(fitted_to, judge.decimate(samples.validation, watched))


def _warn_of_time_limit(name: str) -> None:
    """Warn that a search ended by its time limit, and might have found fewer operations."""
    warnings.warn(
        f"terms.time_limit ended the search for the {name} dynamics; --set terms.time_limit=null searches to the end and "
        "may find fewer operations",
        ParamreduceWarning,
        stacklevel=3,
    )


def _warn_of_accelerations(term: TermModel) -> None:
    """Warn that accelerations are inaccurate although M is positive definite."""
    errors = (term.acceleration_error.estimation, term.acceleration_error.validation)
    if np.nanmax([0.0, *errors]) > 1:
        warnings.warn(
            f"terms: accelerations from the direct dynamics are off by {format_percent(np.nanmax(errors))}, as nothing "
            "asks for more than a positive definite M. Give terms.acceleration_error",
            ParamreduceWarning,
            stacklevel=3,
        )


def _warn_of_missing(names: list[str], others: bool, part: str) -> None:
    """Warn about functions for which no program within the budget was found.

    Raises:
        ConfigError: No other function is left.
    """
    if not names:
        return
    text = (
        f"nothing within {part} was found for the {' and the '.join(names)} dynamics. Allow more, or let "
        "reduction find subsets that are better than that"
    )
    if not others:
        raise ConfigError(f"{text}.", ("terms", "torque_error"))
    warnings.warn(f"terms.torque_error: {text}", ParamreduceWarning, stacklevel=3)


def _make_record(
    best: EvaluatedProgram, judge: Evaluator, front: list[EvaluatedProgram], lean: LeanModels
) -> TermModel | None:
    """Return a program with its errors and front, or None if one of its M is not positive definite."""
    one, (estimation, validation) = best.program, best.errors
    smallest, states = judge.find_smallest_eigenvalue(one) if judge.direct else (np.nan, 0)
    if judge.direct and not smallest > 0:
        return None
    model, program = one.drop_unused()
    strayed, test = judge.measure_deviation(one), judge.compute_test_errors(one)
    whole = (lean.build_direct if judge.direct else lean.build_inverse)(one.start.model)
    return TermModel(
        heuristic=one.start.heuristic,
        n_start=one.start.model.n,
        names=model.names,
        values=model.values,
        units=model.unit_sizes,
        position=model.position,
        program=program.to_stored(),
        projected=judge.projected,
        operations=program.n_operations,
        operations_start=whole.n_operations,
        torque_error=ModelErrors(estimation[0], validation[0], test[0]),
        acceleration_error=ModelErrors(estimation[1], validation[1], test[1]),
        random_torque_error=strayed.torque_error,
        random_acceleration_error=strayed.acceleration_error,
        random_states=strayed.states,
        largest_difference=strayed.largest,
        worst_joint=strayed.worst_joint,
        worst_state=strayed.worst_state,
        smallest_eigenvalue=smallest,
        mass_states=states,
        lower=judge.lower,
        upper=judge.upper,
        drawn=judge.drawn,
        front=_make_front([*front, best], judge),
    )


def _make_front(programs: list[EvaluatedProgram], judge: Evaluator) -> TermFront:
    """Return the Pareto front of programs by operations and worst ratio to the budget."""
    kept: list[EvaluatedProgram] = []
    for one in sorted(programs, key=lambda one: one.rank):
        if not kept or one.worst_ratio < kept[-1].worst_ratio:
            kept.append(one)
    errors = np.array([one.errors for one in kept])
    test = np.array([judge.compute_test_errors(one.program) for one in kept])
    return TermFront(
        operations=np.array([one.rank[0] for one in kept], dtype=np.int64),
        torque_error=SetErrors(errors[:, 0, 0], errors[:, 1, 0], test[:, 0]),
        acceleration_error=SetErrors(errors[:, 0, 1], errors[:, 1, 1], test[:, 1]),
    )
