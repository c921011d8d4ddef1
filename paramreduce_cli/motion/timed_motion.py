"""An exciting trajectory as a controller runs it: there, along it, and back, at its own rate."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.excitation.fourier import fourier_basis, sample_times
from paramreduce_cli.motion.approach import State, Ways, at_rest
from paramreduce_cli.records import FloatArray, Kind, Mechanism, Trajectories, Trajectory

_FINER = 4
"""Points between those of the optimisation's grid, to see where a trajectory goes."""


@dataclass(frozen=True)
class TimedMotion:
    """States at a controller's rate."""

    title: str
    names: tuple[str, ...]
    rate: float
    """Hz"""
    time: FloatArray
    """(n_samples,), s."""
    z: FloatArray
    """Like speeds and accelerations (n_samples, n_dof)."""
    dz: FloatArray
    ddz: FloatArray
    lead: float
    """Seconds before the trajectory itself begins."""
    period: float
    """Seconds that it takes."""


def timed_motion(
    mechanism: Mechanism,
    trajectories: Trajectories,
    trajectory: Trajectory,
    *,
    rate: float,
    title: str,
    start_pose: FloatArray | None = None,
    ways: Ways | None = None,
) -> TimedMotion:
    """A trajectory at some rate, from where the machine stands and back to there.

    Args:
        mechanism: Of the robot.
        trajectories: With the period.
        trajectory: One of them; joints of it may be whole turns away, where that is nearer to the pose.
        rate: Samples per second.
        title: For people.
        start_pose: Where the machine stands, (n_dof,); None to begin with the trajectory itself.
        ways: Finds ways there and back, where there is a pose.

    Raises:
        DataError: No way there and back was found that keeps to limits and bounds.
    """
    period, names = trajectories.period, mechanism.coordinate_names
    harmonics = (trajectory.coefficients.shape[1] - 1) // 2
    turns = np.zeros(mechanism.n_dof)

    def along(time: FloatArray) -> State:
        z, dz, ddz = fourier_basis(period, harmonics, time).states(trajectory.coefficients)
        return z + 2 * np.pi * turns, dz, ddz

    if start_pose is None or ways is None:
        time = np.arange(int(np.floor(period * rate + 1e-9)) + 1) / rate
        z, dz, ddz = along(time)
        return TimedMotion(title, names, rate, time, z, dz, ddz, 0.0, period)
    turns = _turns(mechanism, trajectories, along, start_pose)
    border = tuple(state[0] for state in along(np.zeros(1)))
    there, back = (
        ways.between(at_rest(start_pose), border),
        ways.between(border, at_rest(start_pose)),
    )
    lead = sum(way.duration for way in there)
    parts: list[tuple[float, Callable[[FloatArray], State]]] = [
        *((way.duration, way.states) for way in there),
        (period, along),
        *((way.duration, way.states) for way in back),
    ]
    time, (z, dz, ddz) = _sampled(parts, rate)
    return TimedMotion(title, names, rate, time, z, dz, ddz, lead, period)


def _turns(
    mechanism: Mechanism,
    trajectories: Trajectories,
    along: Callable[[FloatArray], State],
    pose: FloatArray,
) -> FloatArray:
    """Whole turns of joints by which a trajectory begins nearest to a pose, within their limits, (n_dof,).

    After a turn a joint of an open tree is where it was, but the way there may be another one, or none.
    """
    drives = [p.kind for p in mechanism.parameters]
    if mechanism.loops is not None or Kind.STIFFNESS in drives:
        return np.zeros(mechanism.n_dof)
    z = along(sample_times(trajectories.period, _FINER * trajectories.points))[0]
    limits = trajectories.limits
    revolute = [mechanism.bodies[k].joint == "revolute" for k in mechanism.independent]
    turns = np.where(revolute, np.round((pose - z[0]) / (2 * np.pi)), 0.0)
    while True:
        moved = z + 2 * np.pi * turns
        outside = (moved.min(axis=0) < limits.lower) | (moved.max(axis=0) > limits.upper)
        wrong = outside & (turns != 0)
        if not wrong.any():
            return turns
        turns[wrong] -= np.sign(turns[wrong])


def _sampled(
    parts: Sequence[tuple[float, Callable[[FloatArray], State]]], rate: float
) -> tuple[FloatArray, list[FloatArray]]:
    """Times, and states of motions that follow each other, each with its duration; the last sample is the end."""
    ends = np.cumsum([duration for duration, _ in parts])
    time = np.arange(int(np.ceil(ends[-1] * rate - 1e-9)) + 1) / rate
    owner = np.minimum(np.searchsorted(ends, time, side="right"), len(parts) - 1)
    pieces = []
    for k, (duration, motion) in enumerate(parts):
        begin = ends[k] - duration
        pieces.append(motion(np.minimum(time[owner == k] - begin, duration)))
    return time, [np.concatenate(state) for state in zip(*pieces, strict=True)]
