"""The stage optimize-trajectories: exciting trajectories, and point-to-point motions to test models on."""

import warnings
import zlib

import numpy as np

from paramreduce_cli.config.schema import TrajectoriesSection
from paramreduce_cli.errors import DataError, ParamreduceWarning
from paramreduce_cli.excitation.fourier import FINER, evaluate_basis, sample_times
from paramreduce_cli.excitation.optimiser import TrajectorySettings, describe
from paramreduce_cli.excitation.point_to_point import find_point_to_point
from paramreduce_cli.excitation.workers import ExcitationTask, build_excitation, optimise_all
from paramreduce_cli.fields.section import expand_per_joint
from paramreduce_cli.records import (
    SETS,
    Coefficients,
    Constraint,
    FloatArray,
    Items,
    JointLimits,
    Model,
    PointToPoint,
    Run,
    Trajectories,
    Trajectory,
)

_LIMIT_ROUNDING = 1e-9
"""Share by which a limit may be missed: round-off of the series."""


def optimize_trajectories(
    trajectories: TrajectoriesSection,
    model: Model,
    coefficients: Coefficients | None,
    run: Run,
    items: Items,
) -> Trajectories:
    """Find exciting trajectories, or take the Fourier coefficients that the config names.

    Each trajectory is an item, which is stored as soon as it is found: an interrupted run continues with the missing ones.
    """
    settings = trajectories
    period = settings.period if coefficients is None else coefficients.period
    task = make_task(settings, model, period)
    if coefficients is None:
        sets = _optimise_sets(settings, task, items, run)
    else:
        sets = _evaluate_coefficients(settings, model, task, coefficients)
    motions = _find_point_to_point(settings, task, model, period, sets)
    return Trajectories(
        period=period,
        points=settings.points,
        criterion=settings.criterion if coefficients is None else "brought",
        scaling=settings.scaling,
        use_full_range=settings.use_full_range,
        rest_to_rest=settings.rest_to_rest,
        source="" if settings.file is None else settings.file.name,
        limits=task.settings.limits,
        constraints=task.constraints,
        test_point_to_point=motions,
        **sets,
    )


def make_task(
    section: TrajectoriesSection, model: Model, period: float | None = None
) -> ExcitationTask:
    """Return the settings that all trajectories share."""
    return ExcitationTask(
        mechanism=model.mechanism,
        base=model.base,
        base_values=model.base_values,
        torque_scale=_choose_torque_scale(section, model.nominal_torque),
        criterion=section.criterion,
        constraints=section.build_constraints(model.mechanism),
        settings=_make_settings(section, model, period or section.period, section.harmonics),
        seed=section.seed,
    )


def _choose_torque_scale(section: TrajectoriesSection, nominal_torque: FloatArray) -> FloatArray:
    """Return the noise of the torques if it is given, else nominal torques; infinite where nothing is measured."""
    if section.torque_noise is None:
        return nominal_torque
    noise = expand_per_joint(section.torque_noise, nominal_torque.size)
    return np.where(np.isfinite(nominal_torque), noise, np.inf)


def _make_settings(
    section: TrajectoriesSection, model: Model, period: float, harmonics: int
) -> TrajectorySettings:
    """Return the settings of every trajectory."""
    return TrajectorySettings(
        period=period,
        harmonics=harmonics,
        points=max(section.points, 2 * harmonics + 1),
        limits=section.build_limits(model.mechanism.n_dof),
        mapping="gauge" if section.use_full_range else "ball",
        rest_to_rest=section.rest_to_rest,
        start_pose=(
            None
            if section.start_pose is None
            else expand_per_joint(section.start_pose, model.mechanism.n_dof)
        ),
        starts=section.starts,
        polished=section.polished,
        max_iterations=section.max_iterations,
        scaling=section.scaling,
    )


def _optimise_sets(
    section: TrajectoriesSection, task: ExcitationTask, items: Items, run: Run
) -> dict[str, tuple[Trajectory, ...]]:
    """Return optimised trajectories by set."""
    counts = (section.count, section.validation_count, section.test_count)
    keys = {
        name: [f"{name}-{k:04d}" for k in range(count)]
        for name, count in zip(SETS, counts, strict=True)
    }
    found = optimise_all(task, [key for some in keys.values() for key in some], run, items)
    return {name: tuple(found[key] for key in keys[name]) for name in SETS}


def _find_point_to_point(
    section: TrajectoriesSection,
    task: ExcitationTask,
    model: Model,
    period: float,
    sets: dict[str, tuple[Trajectory, ...]],
) -> tuple[PointToPoint, ...]:
    """Find motions between positions of the test trajectories, or of other trajectories if there are none."""
    passed = sets["test"] or sets["validation"] or sets["estimation"]
    times = sample_times(period, section.points)
    positions = [
        evaluate_basis(period, (t.coefficients.shape[1] - 1) // 2, times).evaluate(t.coefficients)[
            0
        ]
        for t in passed
    ]
    found = find_point_to_point(
        model,
        task.settings.limits,
        task.constraints,
        period,
        np.concatenate(positions),
        section.test_point_to_point_count,
        FINER * section.points,
        np.random.default_rng([section.seed, zlib.crc32(b"point-to-point")]),
    )
    if len(found) < section.test_point_to_point_count:
        warnings.warn(
            f"{len(found)} of {section.test_point_to_point_count} point-to-point motions of the test set were found: "
            "straight lines between positions leave the constraints, or need more torque than there is",
            ParamreduceWarning,
            stacklevel=2,
        )
    return found


def _evaluate_coefficients(
    section: TrajectoriesSection, model: Model, task: ExcitationTask, coefficients: Coefficients
) -> dict[str, tuple[Trajectory, ...]]:
    """Return the trajectories of user-supplied coefficients, evaluated but not changed.

    Raises:
        DataError: The coefficients are for another number of joints.
    """
    excitation = build_excitation(task)

    def describe_series(entry: FloatArray) -> Trajectory:
        """Return a user-supplied series as a trajectory with its figures."""
        harmonics = (entry.shape[1] - 1) // 2
        return describe(
            excitation,
            _make_settings(section, model, coefficients.period, harmonics),
            entry,
            kappa_start=np.nan,
            cpu_seconds=0.0,
            iterations=0,
            status="brought",
        )

    sets = {}
    for name in SETS:
        values, n_dof = getattr(coefficients, name), model.mechanism.n_dof
        if values.shape[1] != n_dof:
            raise DataError(
                f"{coefficients.source}: the {name} coefficients are for {values.shape[1]} joints, but "
                f"{model.mechanism.robot} has {n_dof}."
            )
        sets[name] = tuple(describe_series(entry) for entry in values)
        if not sets[name]:
            continue
        _check_motion(coefficients.source, name, sets[name], task.settings.limits)
        _check_bounds(coefficients.source, name, sets[name], task.constraints)
    return sets


def _check_motion(
    source: str, name: str, trajectories: tuple[Trajectory, ...], limits: JointLimits
) -> None:
    """Raise DataError if nothing moves in a trajectory; warn if a joint rests in any of them, or exceeds its position
    or velocity limit.

    Raises:
        DataError: Nothing moves in one of the trajectories.
    """
    moving = np.array([t.reach > 0 for t in trajectories])
    if not moving.any(axis=1).all():
        raise DataError(f"{source}: nothing moves in one of the {name} trajectories.")
    worst = max(
        float(
            max((t.peak_position / limits.reach).max(), (t.peak_velocity / limits.velocity).max())
        )
        for t in trajectories
    )
    for wrong, what in (
        (worst > 1 + _LIMIT_ROUNDING, f"goes to {worst:.3g} times a joint's limit"),
        (not moving.all(), "leaves a joint at rest"),
    ):
        if wrong:
            warnings.warn(
                f"{source}: a trajectory of the {name} set {what}", ParamreduceWarning, stacklevel=2
            )


def _check_bounds(
    source: str,
    name: str,
    trajectories: tuple[Trajectory, ...],
    constraints: tuple[Constraint, ...],
) -> None:
    """Warn of bounded quantities that leave their bounds."""
    for k, constraint in enumerate(constraints):
        low = min(float(t.extremes[k, 0]) for t in trajectories)
        high = max(float(t.extremes[k, 1]) for t in trajectories)
        slack = _LIMIT_ROUNDING * max(abs(low), abs(high))
        if low < constraint.lower - slack or high > constraint.upper + slack:
            warnings.warn(
                f"{source}: {constraint.name} goes from {low:.4g} to {high:.4g} in the {name} set, "
                f"outside its bounds [{constraint.lower:.4g}, {constraint.upper:.4g}]",
                ParamreduceWarning,
                stacklevel=2,
            )
