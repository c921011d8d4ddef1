"""An exciting trajectory as a controller runs it: there, along it, and back, at its own rate."""

from dataclasses import dataclass

import numpy as np

from paramreduce_cli.errors import DataError
from paramreduce_cli.excitation.fourier import fourier_basis
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.quantities import Quantities
from paramreduce_cli.records import FloatArray, Mechanism, Trajectories, Trajectory

_CHECKED = 100
"""Points of a way on which its limits are looked at."""
_LONGER = 1.1
_SHORTEST = 0.1
"""s"""
_LONGEST = 600.0
"""s"""
_GENTLE = 0.5
"""Share of the limits that ways there and back use."""
_ROUNDING = 1e-6


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
    start_pose: FloatArray | None,
    title: str,
) -> TimedMotion:
    """A trajectory at some rate, from where the machine stands and back to there.

    Args:
        mechanism: Of the robot.
        trajectories: With the limits, which ways there and back keep by half.
        trajectory: One of them.
        rate: Samples per second.
        start_pose: Where the machine stands, (n_dof,); None to begin with the trajectory itself.
        title: For people.

    Raises:
        DataError: No way there and back keeps to the limits and bounds.
    """
    period = trajectories.period
    harmonics = (trajectory.coefficients.shape[1] - 1) // 2

    def along(time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        return fourier_basis(period, harmonics, time).states(trajectory.coefficients)

    if start_pose is None:
        time = np.arange(int(np.floor(period * rate + 1e-9)) + 1) / rate
        states = along(time)
        return TimedMotion(title, mechanism.coordinate_names, rate, time, *states, 0.0, period)
    border = tuple(state[0] for state in along(np.zeros(1)))
    still = (start_pose, np.zeros_like(start_pose), np.zeros_like(start_pose))
    there, back = (
        _Way.between(still, border, trajectories),
        _Way.between(border, still, trajectories),
    )
    for way in (there, back):
        _check_bounds(mechanism, trajectories, way)
    ends = np.cumsum([there.duration, period, back.duration])
    time = np.arange(int(np.ceil(ends[2] * rate - 1e-9)) + 1) / rate
    parts = (time < ends[0], (time >= ends[0]) & (time < ends[1]), time >= ends[1])
    pieces = [
        there.states(time[parts[0]]),
        along(time[parts[1]] - ends[0]),
        back.states(np.minimum(time[parts[2]] - ends[1], back.duration)),
    ]
    z, dz, ddz = (np.concatenate(states) for states in zip(*pieces, strict=True))
    return TimedMotion(
        title, mechanism.coordinate_names, rate, time, z, dz, ddz, float(ends[0]), period
    )


State = tuple[FloatArray, ...]


@dataclass(frozen=True)
class _Way:
    """Quintic polynomials between two states of all joints."""

    duration: float
    coefficients: FloatArray
    """Of powers of time over the duration, (6, n_dof)."""

    @classmethod
    def between(cls, start: State, end: State, trajectories: Trajectories) -> "_Way":
        """The shortest of a row of durations that keeps to half of the limits.

        Raises:
            DataError: None does.
        """
        limits = trajectories.limits
        duration = _SHORTEST
        while duration < _LONGEST:
            way = cls(duration, _quintic(start, end, duration))
            z, dz, ddz = way.states(np.linspace(0, duration, _CHECKED))
            fast = np.maximum(_GENTLE * limits.velocity, np.abs([start[1], end[1]]).max(axis=0))
            hard = np.maximum(_GENTLE * limits.acceleration, np.abs([start[2], end[2]]).max(axis=0))
            inside = (z >= limits.lower - _ROUNDING) & (z <= limits.upper + _ROUNDING)
            slow = (np.abs(dz) <= fast * (1 + _ROUNDING)) & (np.abs(ddz) <= hard * (1 + _ROUNDING))
            if inside.all() and slow.all():
                return way
            duration *= _LONGER
        raise DataError(
            "no way between trajectories.start_pose and the trajectory keeps to the limits; choose another "
            "pose within the position limits, or trajectories.rest_to_rest."
        )

    def states(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Positions, speeds and accelerations, (n_samples, n_dof) each."""
        s = time / self.duration
        powers = np.arange(6)
        z = s[:, None] ** powers
        dz, ddz = np.zeros_like(z), np.zeros_like(z)
        dz[:, 1:] = powers[1:] * z[:, :-1] / self.duration
        ddz[:, 2:] = powers[2:] * powers[1:-1] * z[:, :-2] / self.duration**2
        return z @ self.coefficients, dz @ self.coefficients, ddz @ self.coefficients


def _quintic(start: State, end: State, duration: float) -> FloatArray:
    scale = np.array([1.0, duration, duration**2])
    rows = np.array(
        [
            [1, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0], [0, 0, 2, 0, 0, 0],
            [1, 1, 1, 1, 1, 1], [0, 1, 2, 3, 4, 5], [0, 0, 2, 6, 12, 20],
        ],
        dtype=float,
    )  # fmt: skip
    right = np.vstack(
        [state * k for ends in (start, end) for state, k in zip(ends, scale, strict=True)]
    )
    return np.linalg.solve(rows, right)


def _check_bounds(mechanism: Mechanism, trajectories: Trajectories, way: _Way) -> None:
    if not trajectories.constraints:
        return
    z = way.states(np.linspace(0, way.duration, _CHECKED))[0]
    quantities = Quantities(mechanism, trajectories.constraints)
    rows = quantities.rows(Coordinates(mechanism).positions(z, None))
    if rows.max() > 0:
        name = trajectories.constraints[quantities.owners[int(np.argmax(rows.max(axis=0)))]].name
        raise DataError(
            f"the way between trajectories.start_pose and the trajectory misses the bounds of {name}; "
            "choose another pose."
        )
