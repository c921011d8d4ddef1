"""The stage validate: errors and costs of every reduced model, and acceptance of the selected model."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from paramreduce_cli.config.schema import ReductionSection, SelectedSection, ValidationSection
from paramreduce_cli.errors import ConfigError, DataError, Key
from paramreduce_cli.judgement.acceleration_errors import (
    AccelerationErrors,
    compute_acceleration_errors,
)
from paramreduce_cli.judgement.cross_validation import cross_validate
from paramreduce_cli.judgement.model_selection import (
    find_pareto_front,
    list_models,
    list_shown_models,
)
from paramreduce_cli.judgement.operation_counts import OperationCounts
from paramreduce_cli.judgement.selection import select_model
from paramreduce_cli.judgement.stability import measure_stability
from paramreduce_cli.judgement.torque_errors import (
    NormErrors,
    compute_joint_errors,
    compute_torque_errors,
)
from paramreduce_cli.judgement.verdict import find_model_warnings, find_unsafe_models, judge_model
from paramreduce_cli.lean.counting import COUNTS, TEXTBOOK_COUNTS, Counts
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.observation import (
    combine_factors,
    compute_joint_factors,
    decimate_blocks,
)
from paramreduce_cli.multibody.progress_samples import add_progress
from paramreduce_cli.records import (
    Block,
    CountedDynamics,
    CrossValidation,
    DataChange,
    DataVariant,
    FloatArray,
    HeuristicValidation,
    IntArray,
    JointErrors,
    MassMatrices,
    Model,
    Operations,
    Progress,
    ReducedModel,
    Reduction,
    Run,
    Samples,
    SampleSet,
    Selected,
    SelectionMethod,
    SetErrors,
    Stability,
    Validation,
)
from paramreduce_cli.reduction.criteria.torque import TorqueObjective
from paramreduce_cli.reduction.grouping import merge_factor
from paramreduce_cli.reduction.models import make_base_model, make_full_model
from paramreduce_cli.reduction.problem import SelectionProblem
from paramreduce_cli.reduction.setup import make_columns, make_effort, make_problem
from paramreduce_cli.reduction.task import SelectionTask
from paramreduce_cli.reduction.task import run as run_heuristic

_Errors = tuple[NormErrors, AccelerationErrors]
"""Errors of all models, on one set or motion."""
_MEASURED_ON = frozenset(
    {"model.h5", "samples.h5", "reduction.h5", "reduction", "validation.operations"}
)
"""What measurements and stability depend on."""
_MOST_ACCELERATIONS, _FEWEST_ACCELERATIONS = 20_000, 300
"""Most samples of a set, evenly spread, on which models predict accelerations: each takes a mass matrix of
every model, and more of them tell no more. Fewest samples where models are many and large."""
_MOST_PRODUCTS = 6e10
"""Products that the mass matrices of all models on the samples of a set may take: about ten seconds."""
_THINNED = (2, 4, 8)
"""Every so many samples are kept to see what their number does."""
_FOLD_NODES = 5_000
"""Fold nodes of each proof while folds are left out."""
_NODES = 50_000
"""Nodes of each proof while stability is looked at; the best found is good enough there."""


def validate(
    judging: ValidationSection,
    counted: CountedDynamics,
    section: SelectedSection,
    search: ReductionSection,
    model: Model | None,
    samples: Samples,
    reduction: Reduction,
    previous: Validation | None,
    run: Run,
) -> Validation:
    """Compute errors and costs of the reduced models on all sets, select a model and judge it.

    Without a model, on user-supplied samples, only torque errors are computed.

    Errors of the same models on the same samples are taken from the previous run; selection and judgement are repeated.

    The exit code is 0 if the selected model is accepted, and 1 otherwise, with a sentence that says why.
    """
    if model is None:
        _check_without_model(judging, section)
    if samples.test is None:
        _reject_test_limits(judging)
    known = previous if run.unchanged >= _MEASURED_ON else None
    if known:
        measured = _Measured(
            known.heuristics, known.full, known.nominal_acceleration, known.lower, known.upper
        )
    elif model is None:
        measured = _measure_torques(samples, reduction)
    else:
        measured = _measure(model, samples, reduction, counted, run)
    heuristics, full = measured.heuristics, dict(measured.full)
    costs = None if model is None else OperationCounts(model, counted, reduction, run)
    if costs is not None and (costs.are_few or "operations" in section.get_tolerances()):
        heuristics = costs.count(heuristics, list_models(heuristics))
    crossed = None
    if section.cross_validation:
        methods = _list_cross_validated(section, reduction)
        crossed = known.cross_validation if known else None
        if crossed is None or set(crossed) != set(methods):
            crossed = _cross_validate(search, methods, model, samples, reduction, run)
    values = samples.values if model is None else model.values
    unsafe = {name: find_unsafe_models(full, result) for name, result in heuristics.items()}
    selected = select_model(section, values, reduction, heuristics, crossed, unsafe)
    if model is not None and costs is not None:
        full |= _count_operations(Counts(model, counted), "selected_", selected.model)
        estimated = find_pareto_front(costs.estimate(heuristics))
        heuristics = costs.count(heuristics, list_shown_models(heuristics, selected, estimated))
    chosen = (selected.heuristic, selected.n)
    if not judging.stability:
        repeated = None
    elif known and known.stability and (known.selected.heuristic, known.selected.n) == chosen:
        repeated = known.stability
    else:
        repeated = _measure_stability(search, model, samples, reduction, selected, run)
    accepted, sentence = judge_model(judging.accept, selected, heuristics[selected.heuristic])
    return Validation(
        heuristics=heuristics,
        full=full,
        nominal_acceleration=measured.nominal_acceleration,
        lower=measured.lower,
        upper=measured.upper,
        selected=selected,
        pareto=find_pareto_front(heuristics),
        stability=repeated,
        cross_validation=crossed,
        accepted=accepted,
        verdict=sentence,
        warnings=tuple(find_model_warnings(heuristics, full, selected)),
    )


@dataclass(frozen=True)
class _Measured:
    """The errors and costs of all models, before a model is selected."""

    heuristics: Mapping[str, HeuristicValidation]
    full: Mapping[str, float]
    nominal_acceleration: FloatArray
    lower: FloatArray
    upper: FloatArray


def _check_without_model(judging: ValidationSection, section: SelectedSection) -> None:
    """Raise ConfigError if errors of accelerations or operations are asked for.

    Samples without a robot have torques, but no mass matrices and no functions to count.

    Raises:
        ConfigError: An error of accelerations, or a number of operations, is asked for.
    """
    keys: list[Key] = [
        (*key, name)
        for key, limits in ((("selected",), section), (("validation", "accept"), judging.accept))
        for name in limits.model_dump(exclude_none=True)
    ]
    for key in keys:
        if str(key[-1]).startswith(("acceleration_error", "operations")):
            raise ConfigError(
                "user-supplied samples hold torques only, and this needs a model of the robot.", key
            )


def _reject_test_limits(judging: ValidationSection) -> None:
    """Raise ConfigError for limits on a test set if there is none.

    Raises:
        ConfigError: The config limits errors on the test set.
    """
    for name in judging.accept.model_dump(exclude_none=True):
        if "_test" in name:
            raise ConfigError(
                "needs a test set, which samples.h5 does not hold: give trajectories.test_count, coefficients of a test set "
                "in trajectories.file, trajectories.test_point_to_point_count, or sampling.test_file "
                "beside recordings; a log has its held-out part, the validation set, instead.",
                ("validation", "accept", name),
            )


def _measure(
    model: Model, samples: Samples, reduction: Reduction, counted: CountedDynamics, run: Run
) -> _Measured:
    """Return the errors and costs of all models."""
    if samples.validation is None:
        raise DataError("samples.h5 holds no validation set.", command="sample")
    dynamics = Dynamics(model.mechanism)
    nominal = samples.nominal_acceleration
    if nominal is None:
        raise DataError("samples.h5 holds no /nominal_acceleration; it is needed to validate.")
    models = _Models(reduction, model.values)
    _check_coordinates(model, samples)
    each = (nominal.size + 2) * nominal.size * models.values.size
    most = int(np.clip(_MOST_PRODUCTS / each, _FEWEST_ACCELERATIONS, _MOST_ACCELERATIONS))

    def measure(sample_set: SampleSet, name: str, *, by_motion: bool = False) -> list[_Errors]:
        """Errors on a set as a whole, or on each of its motions."""
        n = sample_set.n_samples

        def report_heuristic(what: str) -> Iterator[Block]:
            return add_progress(
                sample_set.iterate_blocks(), n, f"{what} of the {name} set", run.progress
            )

        def parts(blocks: Iterable[Block]) -> Iterator[Iterable[Block]]:
            """Yield the blocks as a whole, or motion by motion."""
            if not by_motion:
                return iter([blocks])
            return (own for _, own in groupby(blocks, lambda block: block.trajectory))

        spread = decimate_blocks(report_heuristic("accelerations"), -(-n // most))
        torques = [
            compute_torque_errors(part, models.values, reduction.nominal_torque)
            for part in parts(report_heuristic("torques"))
        ]
        accelerations = [
            compute_acceleration_errors(
                part, dynamics.compute_mass_matrix_and_bias, models.values, nominal
            )
            for part in parts(spread)
        ]
        return list(zip(torques, accelerations, strict=True))

    (estimation,) = measure(samples.estimation, "estimation")
    (validation,) = measure(samples.validation, "validation")
    test = [] if samples.test is None else measure(samples.test, "test", by_motion=True)
    every = [estimation, validation, *test]
    heuristics = {
        name: _make_validation(found.n, estimation, validation, test, models.rows[name])
        for name, found in reduction.heuristics.items()
    }
    full = _measure_full_model(model, counted, [acceleration for _, acceleration in every])
    return _Measured(heuristics, full, nominal, *_compute_ranges([torque for torque, _ in every]))


def _compute_ranges(sets: Sequence[NormErrors]) -> tuple[FloatArray, FloatArray]:
    """Return the smallest and largest states of all sets, (3, n_dof) each."""
    lower: FloatArray = np.min([one.lower for one in sets], axis=0)
    upper: FloatArray = np.max([one.upper for one in sets], axis=0)
    return lower, upper


def _measure_torques(samples: Samples, reduction: Reduction) -> _Measured:
    """Return the torque errors of all models of samples without a robot; accelerations, mass matrices and operations
    are NaN.

    Raises:
        DataError: The samples hold no validation set.
    """
    if samples.validation is None:
        raise DataError(
            "the samples hold no validation set: /validation/W and /validation/tau are missing."
        )
    models = _Models(reduction, samples.values)
    n_dof = reduction.nominal_torque.size
    unknown = np.full(models.values.shape[1], np.nan)
    no_joint = np.full(n_dof, np.nan)
    nothing = AccelerationErrors(np.tile(unknown[:, None], n_dof), no_joint, unknown, unknown)

    def measure(blocks: Iterable[Block]) -> _Errors:
        return compute_torque_errors(blocks, models.values, reduction.nominal_torque), nothing

    estimation, validation = (
        measure(part.iterate_blocks()) for part in (samples.estimation, samples.validation)
    )
    blocks = samples.test.iterate_blocks() if samples.test is not None else ()
    test = [measure(own) for _, own in groupby(blocks, lambda block: block.trajectory)]
    heuristics = {
        name: _make_validation(found.n, estimation, validation, test, models.rows[name])
        for name, found in reduction.heuristics.items()
    }
    sets = [torque for torque, _ in (estimation, validation, *test)]
    return _Measured(heuristics, {}, no_joint, *_compute_ranges(sets))


def _check_coordinates(model: Model, samples: Samples) -> None:
    """Raise DataError unless the samples hold all coordinates that the loops need."""
    n_q = model.mechanism.n_q
    for part in (samples.estimation, samples.validation, samples.test):
        if part is not None and next(iter(part.iterate_blocks())).q.shape[1] != n_q:
            raise DataError(
                f"samples.h5 holds no q, dq, ddq of all {n_q} coordinates, which the loops need.",
                command="sample",
            )


class _Models:
    """The standard parameters of all reduced models, each different model once, and of the full model last if it is
    known.

    Attributes:
        values: Parameters of each model, (n_standard, n_models).
        rows: Indices, for each heuristic, of the models that its subsets are.
    """

    def __init__(self, reduction: Reduction, full: FloatArray | None) -> None:
        if full is not None and reduction.columns.column.size != full.size:
            raise DataError("reduction.h5 has other parameters than model.h5.", command="run")
        numbers: dict[bytes, int] = {}
        columns: list[FloatArray] = []
        self.rows: dict[str, IntArray] = {}
        for name, found in reduction.heuristics.items():
            rows = []
            for k in range(found.n.size):
                column = reduction.make_model(name, k).standard
                number = numbers.setdefault(column.tobytes(), len(columns))
                if number == len(columns):
                    columns.append(column)
                rows.append(number)
            self.rows[name] = np.array(rows, dtype=np.int64)
        self.values: FloatArray = np.column_stack([*columns, *([] if full is None else [full])])


def _make_validation(
    n: IntArray, estimation: _Errors, validation: _Errors, test: Sequence[_Errors], rows: IntArray
) -> HeuristicValidation:
    """Return the validation of one heuristic from the errors on all sets."""
    every = [acceleration for _, acceleration in (estimation, validation, *test)]
    no_motion = np.zeros((n.size, 0))
    no_joint = np.full(estimation[0].squares.shape, np.nan)
    torques, accelerations = [one for one, _ in test], [one for _, one in test]
    return HeuristicValidation(
        n=n,
        torque_error=SetErrors(
            estimation[0].two[rows],
            validation[0].two[rows],
            np.column_stack([no_motion, *(one.two[rows] for one in torques)]),
        ),
        acceleration_error=SetErrors(
            estimation[1].error[rows],
            validation[1].error[rows],
            np.column_stack([no_motion, *(one.error[rows] for one in accelerations)]),
        ),
        joint_torque_error=JointErrors(
            estimation[0].joints[rows],
            validation[0].joints[rows],
            (compute_joint_errors(torques) if test else no_joint)[rows],
        ),
        joint_acceleration_error=JointErrors(
            estimation[1].joints[rows],
            validation[1].joints[rows],
            (compute_joint_errors(accelerations) if test else no_joint)[rows],
        ),
        mass_matrix=MassMatrices(
            condition=np.max([one.condition[rows] for one in every], axis=0),
            smallest_eigenvalue=np.min([one.smallest_eigenvalue[rows] for one in every], axis=0),
        ),
        operations=Operations(np.full(n.size, np.nan), np.full(n.size, np.nan)),
    )


def _measure_full_model(
    model: Model, counted: CountedDynamics, sets: Sequence[AccelerationErrors]
) -> dict[str, float]:
    """Return operations and mass-matrix properties of the full model, by name."""
    counts = Counts(model, counted)
    result = _count_operations(counts, "", make_full_model(model))
    result |= _count_operations(counts, "base_", make_base_model(model))
    result["mass_matrix_condition"] = float(max(one.condition[-1] for one in sets))
    smallest = min(one.smallest_eigenvalue[-1] for one in sets)
    result["mass_matrix_smallest_eigenvalue"] = float(smallest)
    return result


def _count_operations(counts: Counts, prefix: str, chosen: ReducedModel) -> dict[str, float]:
    """Count operations of a model: lean, and by textbook recursion."""
    names = [prefix + name for name in (*COUNTS, *TEXTBOOK_COUNTS)]
    return dict(
        zip(names, [*counts.count_lean(chosen), *counts.count_textbook(chosen)], strict=True)
    )


def _list_cross_validated(section: SelectedSection, reduction: Reduction) -> dict[str, str]:
    """Return the heuristics for cross-validation by the name of the method that ran.

    Raises:
        ConfigError: No heuristic selects by torque.
    """
    methods = {name: SelectionMethod.parse(name) for name in reduction.heuristics}
    found = {
        name: method.heuristic
        for name, method in methods.items()
        if method.by_torque and section.heuristic in (None, name)
    }
    if not found:
        raise ConfigError(
            "needs a heuristic that selects by torque.", ("selected", "cross_validation")
        )
    return found


def _cross_validate(
    search: ReductionSection,
    methods: Mapping[str, str],
    model: Model | None,
    samples: Samples,
    reduction: Reduction,
    run: Run,
) -> dict[str, CrossValidation]:
    """Return the errors with each trajectory left out, of the heuristics that select by torque."""
    factors = samples.estimation.compute_factors()
    if len(factors) < 2:
        raise ConfigError(
            "needs at least two trajectories, or folds of a log, to leave one out.",
            ("selected", "cross_validation"),
        )
    grouped = make_columns(search, samples)
    weights = reduction.nominal_torque

    def factor(part: FloatArray) -> FloatArray:
        return merge_factor(combine_factors(part, weights), grouped.columns)

    folds = [
        (factor(np.delete(factors, k, axis=0)), factor(factors[k : k + 1]))
        for k in range(len(factors))
    ]
    problem = make_problem(reduction.factor, model, grouped, samples.values)
    quick = replace(make_effort(search, run), kicks=0, node_limit=_FOLD_NODES)
    found = {}
    for k, (name, heuristic) in enumerate(methods.items()):
        run.progress(Progress("cross-validation", k, len(methods), name))

        def select(other: SelectionProblem, heuristic: str = heuristic) -> Sequence[IntArray]:
            """Return the subsets of a heuristic on other data, of the same sizes."""
            task = SelectionTask(TorqueObjective(other), reduction.rank, effort=quick)
            sizes = set(reduction.heuristics[heuristic].n.tolist())
            return [s for s in run_heuristic(heuristic, task).subsets if s.size in sizes]

        result = cross_validate(problem, folds, select)
        if result.n.size:
            found[name] = result
    run.progress(Progress("cross-validation", len(methods), len(methods)))
    if not found:
        raise ConfigError(
            "finds no size of subset that comes up with every part left out; ask for more parameters in "
            "reduction.stop, or for smaller groups.",
            ("selected", "cross_validation"),
        )
    return found


def _measure_stability(
    search: ReductionSection,
    model: Model | None,
    samples: Samples,
    reduction: Reduction,
    selected: Selected,
    run: Run,
) -> Stability:
    """Repeat the selection by torque without each trajectory and with fewer samples."""
    grouped = make_columns(search, samples)
    weights = reduction.nominal_torque
    problem = make_problem(reduction.factor, model, grouped, samples.values)
    quick = replace(make_effort(search, run), node_limit=_NODES)
    heuristic = SelectionMethod.parse(selected.heuristic).heuristic

    def factor(factors: FloatArray) -> FloatArray:
        return merge_factor(combine_factors(factors, weights), grouped.columns)

    def select(other: SelectionProblem) -> IntArray:
        """Return the subset of the selected size on other data."""
        task = SelectionTask(TorqueObjective(other), selected.n, smallest=selected.n, effort=quick)
        found = run_heuristic(heuristic, task).subsets
        # With groups the size itself may not come up on other data.
        fitting = [subset for subset in found if subset.size <= selected.n]
        return fitting[-1] if fitting else np.zeros(0, np.int64)

    own = samples.estimation.compute_factors()
    variants = [(DataVariant(DataChange.ALL), reduction.factor)]
    for k in range(len(own) if len(own) > 1 else 0):
        left_out = DataVariant(DataChange.WITHOUT_TRAJECTORY, k + 1)
        variants.append((left_out, factor(np.delete(own, k, axis=0))))
    rows = samples.estimation.n_samples * weights.size
    for every in _THINNED:
        if rows // every >= 2 * problem.candidates.size:
            blocks = decimate_blocks(samples.estimation.iterate_blocks(), every)
            thinned = DataVariant(DataChange.THINNED, every)
            variants.append((thinned, factor(compute_joint_factors(blocks))))
    return measure_stability(problem, variants, select, run.progress)
