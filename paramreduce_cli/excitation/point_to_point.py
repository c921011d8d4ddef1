"""Point-to-point motions: from rest to rest along a straight line in joint space, with the least jerk [Flash1985]."""

from collections.abc import Sequence

import numpy as np

from paramreduce_cli.errors import DataError
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.observation import Span, StateBlock, StatesAt
from paramreduce_cli.multibody.quantities import Quantities
from paramreduce_cli.records import Constraint, FloatArray, JointLimits, Model, PointToPoint

_PEAK_SPEED = 1.875
"""Largest speed of a motion over a unit in unit time; the largest acceleration is below."""
_PEAK_ACCELERATION = 10 / np.sqrt(3)
_TRIES = 30
"""Pairs of positions that are tried for each motion that is asked for."""
_SLOWER = 1.25
"""Factor by which a motion is made slower while it takes more torque or power than there is."""
_SLOWDOWNS = 12


def evaluate_point_to_point(
    motion: PointToPoint, time: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the states of a motion at given times.

    Args:
        motion: The motion.
        time: Times since the beginning of the motion, (n_points,), s.

    Returns:
        z, dz and ddz, each (n_points, n_dof).
    """
    x = (time / motion.duration)[:, None]
    displacement = motion.end - motion.start
    z = motion.start + displacement * x**3 * (10 + x * (6 * x - 15))
    dz = displacement / motion.duration * 30 * (x * (1 - x)) ** 2
    ddz = displacement / motion.duration**2 * 60 * x * (1 - x) * (1 - 2 * x)
    return z, dz, ddz


def sample_point_to_point_times(motion: PointToPoint, points: int) -> FloatArray:
    """Return equidistant times from the beginning of a motion to its end, (points,), s."""
    return np.linspace(0.0, motion.duration, points)


def evaluate_along(motions: Sequence[PointToPoint], points: int, finer: int) -> StatesAt:
    """Return a function that evaluates the states of a span of the motions.

    Args:
        motions: The motions.
        points: Number of samples of each motion.
        finer: Factor by which the grid on which loops are followed is finer; 1 without loops.
    """

    def evaluate_span(span: Span) -> StateBlock:
        """Return the states of a span."""
        motion = motions[span.trajectory]
        times = sample_point_to_point_times(motion, points)[span.start : span.stop]
        step = motion.duration / (points - 1) / finer
        between = times[0] + step * np.arange(finer * times.size)
        positions = evaluate_point_to_point(motion, np.minimum(between, motion.duration))[0]
        states = evaluate_point_to_point(motion, times)
        return StateBlock(
            span.trajectory, times, *states, fine_positions=positions if finer > 1 else None
        )

    return evaluate_span


def find_point_to_point(
    model: Model,
    limits: JointLimits,
    constraints: tuple[Constraint, ...],
    period: float,
    positions: FloatArray,
    count: int,
    points: int,
    rng: np.random.Generator,
) -> tuple[PointToPoint, ...]:
    """Find motions between random pairs of positions, each as fast as the limits allow.

    Args:
        model: Model of the robot, whose torques keep to the limits.
        limits: Limits of the independent coordinates.
        constraints: Bounds on other quantities along the way.
        period: Period of other motions, s; half of it is the least duration where a joint that moves has no limit of
            speed or acceleration.
        positions: Positions that keep to all of these, (n_positions, n_dof), rad or m.
        count: Number of motions.
        points: Points along each motion at which it is checked.
        rng: Source of the pairs.

    Returns:
        The motions; fewer than asked for where most straight lines leave the constraints.
    """
    within = _MotionLimits(model, limits, constraints, period, points)
    found: list[PointToPoint] = []
    for _ in range(_TRIES * count):
        if len(found) == count:
            break
        start, end = positions[rng.integers(len(positions), size=2)]
        motion = within.find_fastest(start, end)
        if motion is not None:
            found.append(motion)
    return tuple(found)


class _MotionLimits:
    """A search for the fastest motion within limits.

    Args:
        model: Model of the robot.
        limits: Limits of the independent coordinates.
        constraints: Bounds on other quantities.
        period: Period of other motions, s.
        points: Points along each motion at which they are evaluated.
    """

    def __init__(
        self,
        model: Model,
        limits: JointLimits,
        constraints: tuple[Constraint, ...],
        period: float,
        points: int,
    ) -> None:
        self._values, self._limits, self._points = model.values, limits, points
        unlimited = np.isinf(limits.velocity) & np.isinf(limits.acceleration)
        self._least = np.where(unlimited, period / 2, 0.0)
        self._coordinates = Coordinates(model.mechanism, once=True)
        self._quantities = Quantities(model.mechanism, constraints)
        self._dynamics = Dynamics(model.mechanism)

    def find_fastest(self, start: FloatArray, end: FloatArray) -> PointToPoint | None:
        """Return the fastest motion between two positions within the limits; None if there is none."""
        distance = np.abs(end - start)
        duration = max(
            float(np.max(_PEAK_SPEED * distance / self._limits.velocity)),
            float(np.sqrt(np.max(_PEAK_ACCELERATION * distance / self._limits.acceleration))),
            float(np.max(self._least[distance > 0], initial=0.0)),
        )
        motion = PointToPoint(start, end, duration)
        if duration == 0 or not self._is_free(motion):
            return None
        for _ in range(_SLOWDOWNS):
            if self.keeps_load_limits(motion):
                return motion
            motion = PointToPoint(start, end, motion.duration * _SLOWER)
        return None

    def _is_free(self, motion: PointToPoint) -> bool:
        """Whether the loops close along a motion and all constraints hold."""
        time = sample_point_to_point_times(motion, self._points)
        z, _, _ = evaluate_point_to_point(motion, time)
        try:
            q = self._coordinates.compute_positions(z, None)
            self._coordinates.check_motion(time, q)
        except DataError:
            return False
        return bool((self._quantities.compute_rows(q) <= 0).all())

    def keeps_load_limits(self, motion: PointToPoint) -> bool:
        """Whether the torques and powers that the model predicts for a motion are within their limits."""
        torque, power = self._limits.torque, self._limits.power
        if not (np.isfinite(torque).any() or np.isfinite(power).any()):
            return True
        z, dz, ddz = evaluate_point_to_point(
            motion, sample_point_to_point_times(motion, self._points)
        )
        states = self._coordinates.compute_states(z, dz, ddz)
        tau = np.abs(self._dynamics.compute_torques(*states, self._values))
        return bool(((tau <= torque) & (tau * np.abs(dz) <= power)).all())
