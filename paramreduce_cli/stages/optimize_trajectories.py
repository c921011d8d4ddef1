"""optimize-trajectories: exciting trajectories for both sets."""

from __future__ import annotations

import warnings

import numpy as np

from paramreduce_cli.config import Config
from paramreduce_cli.errors import DataError, ParamreduceWarning
from paramreduce_cli.excitation.limits import JointLimits
from paramreduce_cli.excitation.optimiser import Settings, describe
from paramreduce_cli.excitation.workers import Task, excitation_of, optimise_all
from paramreduce_cli.records import (
    Coefficients,
    Constraint,
    FloatArray,
    Model,
    Run,
    Trajectories,
    Trajectory,
)
from paramreduce_cli.registry import stage
from paramreduce_cli.stages.description import described_constraints

_SETS = ("estimation", "validation")
_ROUNDING = 1e-9


@stage
def optimize_trajectories(
    config: Config, model: Model, coefficients: Coefficients | None, run: Run
) -> Trajectories:
    """Find exciting trajectories, or take the Fourier coefficients that the config names.

    Finished trajectories are kept at once: an interrupted run goes on with what is missing.
    """
    wanted = config.trajectories
    if coefficients is not None:
        return _measured(config, model, coefficients)
    task = Task(
        mechanism=model.mechanism,
        base=model.base,
        nominal_torque=model.nominal_torque,
        criterion=wanted.criterion,
        constraints=described_constraints(config, model.mechanism),
        settings=joint_settings(config, wanted.period, wanted.harmonics),
        seed=wanted.seed,
    )
    counts = {"estimation": wanted.count, "validation": wanted.validation_count}
    keys = [f"{name}-{k:04d}" for name in _SETS for k in range(counts[name])]
    found = optimise_all(task, keys, run)
    sets = {name: tuple(found[key] for key in keys if key.startswith(name)) for name in _SETS}
    return Trajectories(
        wanted.period,
        wanted.criterion,
        wanted.scaling,
        task.constraints,
        sets["estimation"],
        sets["validation"],
    )


def joint_limits(config: Config) -> JointLimits:
    """The limits of every joint."""
    wanted, n = config.trajectories, config.n_dof
    pairs = np.array(wanted.position_limits, dtype=float)
    pairs = np.broadcast_to(pairs, (n, 2)) if len(pairs) == 1 else pairs
    return JointLimits(
        lower=pairs[:, 0],
        upper=pairs[:, 1],
        velocity=config.per_joint(wanted.velocity_limits),
        acceleration=config.per_joint(wanted.acceleration_limits or [np.inf]),
    )


def joint_settings(config: Config, period: float, harmonics: int) -> Settings:
    """What the config asks of every trajectory."""
    wanted = config.trajectories
    return Settings(
        period=period,
        harmonics=harmonics,
        points=max(wanted.points, 2 * harmonics + 1),
        limits=joint_limits(config),
        mapping="gauge" if wanted.use_full_range else "ball",
        starts=wanted.starts,
        polished=wanted.polished,
        max_iterations=wanted.max_iterations,
        scaling=wanted.scaling,
    )


def _measured(config: Config, model: Model, brought: Coefficients) -> Trajectories:
    """The trajectories of coefficients that the user brings, measured but not changed."""
    wanted, n = config.trajectories, config.n_dof
    constraints = described_constraints(config, model.mechanism)
    excitation = excitation_of(
        model.mechanism,
        model.base,
        model.nominal_torque,
        wanted.criterion,
        wanted.scaling,
        constraints,
    )

    def measure(coefficients: FloatArray) -> Trajectory:
        settings = joint_settings(config, brought.period, (coefficients.shape[1] - 1) // 2)
        return describe(
            excitation,
            settings,
            coefficients,
            kappa_start=np.nan,
            cpu_seconds=0.0,
            iterations=0,
            status="brought",
        )

    sets = {}
    for name in _SETS:
        values = getattr(brought, name)
        if values.shape[1] != n:
            raise DataError(
                f"{brought.source}: the {name} coefficients are for {values.shape[1]} joints, but "
                f"{config.robot} has {n}."
            )
        sets[name] = tuple(measure(entry) for entry in values)
        _check_motion(brought.source, name, sets[name], joint_limits(config))
        _check_bounds(brought.source, name, sets[name], constraints)
    return Trajectories(
        brought.period,
        "brought",
        wanted.scaling,
        constraints,
        sets["estimation"],
        sets["validation"],
    )


def _check_motion(
    source: str, name: str, trajectories: tuple[Trajectory, ...], limits: JointLimits
) -> None:
    """Refuse trajectories in which nothing moves; remark on joints that rest or go too far."""
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
        (worst > 1 + _ROUNDING, f"goes to {worst:.3g} times a joint's limit"),
        (not moving.all(), "leaves a joint at rest"),
    ):
        if wrong:
            warnings.warn(
                f"{source}: a trajectory of the {name} set {what}",
                ParamreduceWarning,
                stacklevel=2,
            )


def _check_bounds(
    source: str,
    name: str,
    trajectories: tuple[Trajectory, ...],
    constraints: tuple[Constraint, ...],
) -> None:
    """Remark on bounded quantities that leave their bounds."""
    for k, constraint in enumerate(constraints):
        low = min(float(t.extremes[k, 0]) for t in trajectories)
        high = max(float(t.extremes[k, 1]) for t in trajectories)
        slack = _ROUNDING * max(abs(low), abs(high))
        if low < constraint.lower - slack or high > constraint.upper + slack:
            warnings.warn(
                f"{source}: {constraint.name} goes from {low:.4g} to {high:.4g} in the {name} set, "
                f"outside its bounds [{constraint.lower:.4g}, {constraint.upper:.4g}]",
                ParamreduceWarning,
                stacklevel=2,
            )
