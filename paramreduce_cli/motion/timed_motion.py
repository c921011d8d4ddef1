"""An exciting trajectory with its approach and return, sampled at a controller's rate."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.excitation.fourier import evaluate_basis, sample_times
from paramreduce_cli.motion.approach import PathPlanner, State, make_rest_state
from paramreduce_cli.records import FloatArray, Kind, Mechanism, Trajectories, Trajectory

_FINER = 4
"""Points between those of the optimisation's grid, to see where a trajectory goes."""


@dataclass(frozen=True)
class TimedMotion:
    """A motion as states at a controller's rate."""

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


def sample_motion(
    mechanism: Mechanism,
    trajectories: Trajectories,
    trajectory: Trajectory,
    *,
    rate: float,
    title: str,
    start_pose: FloatArray | None = None,
    planner: PathPlanner | None = None,
) -> TimedMotion:
    """Return a trajectory at some rate, from the pose of the machine and back to it.

    Args:
        mechanism: Mechanism of the robot.
        trajectories: Trajectories with their period.
        trajectory: Trajectory to run; its joints may be whole revolutions away if that is nearer to the pose.
        rate: Samples per second.
        title: Title for people.
        start_pose: Position where the machine stands, (n_dof,); None to begin with the trajectory itself.
        planner: Finds ways there and back, where there is a pose.

    Raises:
        DataError: No way there and back was found that keeps to limits and bounds.
    """
    period, names = trajectories.period, mechanism.coordinate_names
    harmonics = (trajectory.coefficients.shape[1] - 1) // 2
    turns = np.zeros(mechanism.n_dof)

    def evaluate(time: FloatArray) -> State:
        """Return the states of the trajectory, moved by whole revolutions."""
        z, dz, ddz = evaluate_basis(period, harmonics, time).evaluate(trajectory.coefficients)
        return z + 2 * np.pi * turns, dz, ddz

    if start_pose is None or planner is None:
        time = np.arange(int(np.floor(period * rate + 1e-9)) + 1) / rate
        z, dz, ddz = evaluate(time)
        return TimedMotion(title, names, rate, time, z, dz, ddz, 0.0, period)
    turns = _choose_revolutions(mechanism, trajectories, evaluate, start_pose)
    border = tuple(state[0] for state in evaluate(np.zeros(1)))
    approach, retreat = (
        planner.plan(make_rest_state(start_pose), border),
        planner.plan(border, make_rest_state(start_pose)),
    )
    lead = sum(segment.duration for segment in approach)
    parts: list[tuple[float, Callable[[FloatArray], State]]] = [
        *((segment.duration, segment.compute_states) for segment in approach),
        (period, evaluate),
        *((segment.duration, segment.compute_states) for segment in retreat),
    ]
    time, (z, dz, ddz) = _sample_parts(parts, rate)
    return TimedMotion(title, names, rate, time, z, dz, ddz, lead, period)


def _choose_revolutions(
    mechanism: Mechanism,
    trajectories: Trajectories,
    along: Callable[[FloatArray], State],
    pose: FloatArray,
) -> FloatArray:
    """Return the numbers of whole revolutions of joints that bring the start of a trajectory nearest to a pose within
    the limits, (n_dof,).

    A joint of an open tree has the same pose after a whole revolution, but the path to it may differ or not exist.
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


def _sample_parts(
    parts: Sequence[tuple[float, Callable[[FloatArray], State]]], rate: float
) -> tuple[FloatArray, list[FloatArray]]:
    """Return times and states of motions that follow each other, each with its duration; the last sample is the end."""
    ends = np.cumsum([duration for duration, _ in parts])
    time = np.arange(int(np.ceil(ends[-1] * rate - 1e-9)) + 1) / rate
    owner = np.minimum(np.searchsorted(ends, time, side="right"), len(parts) - 1)
    pieces = []
    for k, (duration, motion) in enumerate(parts):
        begin = ends[k] - duration
        pieces.append(motion(np.minimum(time[owner == k] - begin, duration)))
    return time, [np.concatenate(state) for state in zip(*pieces, strict=True)]
