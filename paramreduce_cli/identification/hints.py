"""Hints at likely causes of large errors of a fit, the most important first."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from paramreduce_cli.identification.estimation import LinearFit
from paramreduce_cli.identification.joint_hypotheses import hint_at_joint_frames
from paramreduce_cli.identification.prediction_uncertainty import (
    compute_torque_uncertainty,
    hint_at_undetermined_torques,
)
from paramreduce_cli.identification.residual_hints import (
    find_residual_hints,
    hint_at_negative_friction,
)
from paramreduce_cli.identification.torque_hints import (
    hint_at_gravity,
    hint_at_rating,
    hint_at_sign,
    hint_at_unit,
)
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.records import (
    DRIVE,
    INERTIAL,
    BoolArray,
    Consistency,
    Estimate,
    FloatArray,
    Kind,
    MeasuredLog,
    Model,
    SampleSet,
)
from paramreduce_cli.texts import format_percent

_HARDLY = 0.3
"""Share of the torques that is left where hardly anything was understood."""
_FARTHER = 2.5
"""Times the error of what was learned from, from which on what was held out is said to be missed."""
_IMPOSSIBLE = 1.15
"""Error of bodies that can exist over that of base parameters, from which on there is a hint at wrong kinematics: between 1.00 to 1.06 on logs
of three robots themselves, and 1.26 to 1.32 with the kinematics of others (docs/lab/logs.md)."""
_BESIDE = 0.003
"""Share of the torques by which errors must differ besides: solvers are not exact, and where a low-pass leaves little, base
parameters fit noise that bodies cannot (0.0016 on the Panda's own log with a cut-off from the spectrum; 0.007 with other kinematics)."""
_NOTABLE = 0.1
"""Share of the torques from which on that is worth a word."""
_SEARCHED = 0.05
"""Share of the torques from which on other zeros, directions and orders of joints are tried."""
_FRICTION = (Kind.COULOMB, Kind.VISCOUS)
_ACROSS = 1e-6
"""Share of gravity below which an axis counts as level."""
_ENOUGH = 6000
"""Torques that are looked at where not all are needed."""


def find_hints(
    model: Model,
    training: SampleSet,
    full: Estimate,
    fitted: LinearFit,
    consistency: Consistency | None,
    log: MeasuredLog | None,
) -> list[str]:
    """Return hints at likely causes of large errors, the most important first.

    Args:
        model: Model of the machine.
        training: Training samples.
        full: Estimate of all base parameters.
        fitted: Fit of all base parameters, with its residuals.
        consistency: Physically consistent parameters; None if they were not computed.
        log: Log from which the samples were made; None if they are not from a log.
    """
    tuned = () if log is None or log.friction is None else log.friction.drives
    looked_at = _sample_states(model, training)
    gravity = hint_at_gravity(
        looked_at.W, looked_at.pulls, looked_at.tau, fitted.deviation, model.mechanism.gravity
    )
    mechanism = model.mechanism
    names = mechanism.coordinate_names
    wrong = gravity
    if not wrong and full.train > _SEARCHED and mechanism.loops is None:
        measured = np.isfinite(fitted.deviation)
        wrong = list(
            hint_at_joint_frames(
                looked_at.dynamics, looked_at.states, looked_at.tau, measured, names
            )
        )
    wrong = wrong or hint_at_sign(
        looked_at.exact, looked_at.iterate_mirrored(), looked_at.tau, fitted.deviation, names
    )
    if wrong:  # what else is seen follows from that
        return [*_hint_at_large_errors(full), *wrong]
    uncertainty = compute_torque_uncertainty(looked_at.dynamics, model.base.columns, fitted)
    return [
        *_hint_at_large_errors(full),
        *hint_at_undetermined_torques(*uncertainty, np.isfinite(fitted.deviation), names),
        *_hint_at_bodies(model, looked_at, full, np.isfinite(fitted.deviation)),
        *find_residual_hints(
            fitted,
            names,
            _compute_tilt_torques(model, training, fitted),
            gravity=float(np.linalg.norm(mechanism.gravity)),
            delay=0.0 if log is None else log.delay,
            sliding=[mechanism.bodies[k].joint == "prismatic" for k in mechanism.independent],
            modelled=[
                f"drives.{p.owner}.{p.kind.key}" for p in mechanism.parameters if p.kind in DRIVE
            ],
            tuned=tuned,
        ),
        *_hint_at_friction(model, full),
        *_hint_at_impossible_bodies(full, consistency),
    ]


def _hint_at_large_errors(full: Estimate) -> Iterator[str]:
    """Yield hints at a wrong log or robot if the training error is large, or the held-out error much larger than the
    training error.
    """
    if full.train > _HARDLY:
        yield (
            f"All base parameters together leave {format_percent(full.train)} of the torques unexplained: is the log of this "
            "robot, are its columns in this order, is friction modelled?"
        )
    if full.held_out > _FARTHER * full.train and full.held_out > _NOTABLE:
        yield (
            f"Torques that were held out are missed by {format_percent(full.held_out)}, those that were learned from by "
            f"{format_percent(full.train)}: is the log of this robot, does it excite all parameters, are its parts of the same motion?"
        )


def _hint_at_impossible_bodies(full: Estimate, consistency: Consistency | None) -> Iterator[str]:
    """Yield a hint if only physically impossible bodies explain the torques, which suggests the kinematics of another
    robot.
    """
    if consistency is None or full.train > _HARDLY:
        return
    if consistency.train > max(_IMPOSSIBLE * full.train, full.train + _BESIDE):
        yield (
            f"Bodies and friction that can exist leave {format_percent(consistency.train)} of the torques unexplained, base "
            f"parameters without that restriction {format_percent(full.train)}: is the log of this robot, are the kinematics in "
            "the config right, and are friction and rotors modelled?"
        )


@dataclass(frozen=True)
class _SampledStates:
    """A subset of samples, taken evenly from all."""

    W: FloatArray
    """(n_samples, n_dof, n_standard)"""
    pulls: FloatArray
    """What gravity of one unit along each axis of the base adds to W, (3, n_samples, n_dof, n_standard)."""
    tau: FloatArray
    """(n_samples, n_dof), N m or N."""
    states: tuple[FloatArray, FloatArray, FloatArray]
    """Generalised coordinates, their speeds and accelerations."""
    dynamics: Dynamics

    @property
    def exact(self) -> FloatArray:
        """W of the states, without the low-pass of the torques, (n_samples, n_dof, n_standard)."""
        return self.dynamics.compute_regressor(*self.states)

    def iterate_mirrored(self) -> Iterator[FloatArray]:
        """Yield the regressor with each joint reversed; nothing with loops, where joints depend on each other."""
        if self.dynamics.mechanism.loops is not None:
            return
        for j in range(self.states[0].shape[1]):
            sign = np.ones(self.states[0].shape[1])
            sign[j] = -1
            yield self.dynamics.compute_regressor(*(sign * state for state in self.states))


def _sample_states(model: Model, training: SampleSet) -> _SampledStates:
    """Return a subset of the training samples."""
    mechanism = model.mechanism
    every = max(1, training.n_samples * mechanism.n_dof // _ENOUGH)
    still, *along = (
        Dynamics(replace(mechanism, gravity=axis), once=True) for axis in (np.zeros(3), *np.eye(3))
    )
    W, pulls, tau, seen = [], [], [], 0
    states: list[tuple[FloatArray, ...]] = []
    for block in training.iterate_blocks():
        picked = slice(-seen % every, None, every)
        seen += len(block.tau)
        q = block.q[picked]
        if len(q):
            W.append(block.W.reshape(*block.tau.shape, -1)[picked])
            tau.append(block.tau[picked])
            states.append((q, block.dq[picked], block.ddq[picked]))
            weightless = still.compute_regressor(q, np.zeros_like(q), np.zeros_like(q))
            pulls.append(
                [
                    d.compute_regressor(q, np.zeros_like(q), np.zeros_like(q)) - weightless
                    for d in along
                ]
            )
    q, dq, ddq = (np.concatenate(parts) for parts in zip(*states, strict=True))
    return _SampledStates(
        np.concatenate(W),
        np.concatenate(pulls, axis=1),
        np.concatenate(tau),
        (q, dq, ddq),
        Dynamics(mechanism),
    )


def _hint_at_bodies(
    model: Model, sampled: _SampledStates, full: Estimate, measured: BoolArray
) -> list[str]:
    """Return hints that compare torques with the config's values of bodies and ratings of joints."""
    bodies = [k for k, p in enumerate(model.mechanism.parameters) if p.kind in INERTIAL]
    W = sampled.W[:, measured][:, :, bodies]
    found = hint_at_unit(W @ model.values[bodies], W @ full.standard[bodies])
    if found or not model.nominal_torque_given:
        return found
    return hint_at_rating(sampled.tau, model.nominal_torque, model.mechanism.coordinate_names)


def _compute_tilt_torques(
    model: Model, training: SampleSet, fitted: LinearFit
) -> list[tuple[FloatArray, ...]]:
    """Return the torques of gravity along the base's horizontal axes, with the known masses."""
    mechanism = model.mechanism
    level = np.abs(mechanism.gravity) <= _ACROSS * np.linalg.norm(mechanism.gravity)
    if (
        not level[:2].all()
        or not np.any(model.values)
        or len(fitted.rows.X) != len({block.trajectory for block in training.iterate_blocks()})
    ):
        return []
    found = []
    without = Dynamics(replace(mechanism, gravity=np.zeros(3)))
    for axis in np.eye(3)[:2]:
        tilted = Dynamics(replace(mechanism, gravity=axis))
        parts: dict[int, list[FloatArray]] = {}
        for block in training.iterate_blocks():
            still = np.zeros_like(block.q)
            K = tilted.compute_regressor(block.q, still, still)
            weightless = without.compute_regressor(block.q, still, still)
            parts.setdefault(block.trajectory, []).append((K - weightless) @ model.values)
        found.append(tuple(np.concatenate(part) for part in parts.values()))
    return found


def _hint_at_friction(model: Model, full: Estimate) -> list[str]:
    """Return hints at negative friction among the base parameters."""
    kinds = {p.name: p for p in model.mechanism.parameters if p.kind in _FRICTION}
    indices = [k for k, name in enumerate(full.names) if name in kinds]
    found = [kinds[full.names[k]] for k in indices]
    return hint_at_negative_friction(
        [p.name for p in found],
        [p.owner for p in found],
        full.values[indices],
        full.deviations[indices],
    )
