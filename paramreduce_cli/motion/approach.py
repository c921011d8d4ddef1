"""Smooth ways between states of a machine, within its limits and clear of what it could hit.

Quintic polynomials of time, straight between two poses. Where the straight way is not clear, others are passed, at
rest: random ones, of which straight ways are tried in the order of their length [Bohlin2000].
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse.csgraph import dijkstra

from paramreduce_cli.errors import DataError
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.quantities import Quantities
from paramreduce_cli.records import FloatArray, Model, Trajectories

_CHECKED = 100
"""Points of a way on which its limits are looked at."""
_LONGER = 1.1
_SHORTEST = 0.1
"""s"""
_LONGEST = 600.0
"""s"""
_GENTLE = 0.5
"""Share of the limits of speed and acceleration that ways use."""
_ROUNDING = 1e-6
_POSES = 600
"""Poses that are looked at where the straight way is not clear."""
_FARTHEST = 0.5
"""Standard deviation of the last of them, a share of the joints' ranges."""
_TRIED = 600
"""Straight ways between them that are tried."""
_MANY_SHORT = 1.5
"""Exponent of lengths by which several short ways are preferred to a long one."""

State = tuple[FloatArray, ...]
"""Position, speed and acceleration of all joints, (n_dof,) each."""


class _NoPathError(DataError):
    """A straight way is none."""


@dataclass(frozen=True)
class Segment:
    """A segment of a motion: quintic polynomials between two states of all joints."""

    duration: float
    """s"""
    coefficients: FloatArray
    """Coefficients of powers of time over the duration, (6, n_dof)."""

    def compute_states(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return positions, speeds and accelerations, (n_samples, n_dof) each."""
        s = time / self.duration
        powers = np.arange(6)
        z = s[:, None] ** powers
        dz, ddz = np.zeros_like(z), np.zeros_like(z)
        dz[:, 1:] = powers[1:] * z[:, :-1] / self.duration
        ddz[:, 2:] = powers[2:] * powers[1:-1] * z[:, :-2] / self.duration**2
        return z @ self.coefficients, dz @ self.coefficients, ddz @ self.coefficients


def make_rest_state(pose: FloatArray) -> State:
    """Return the state of a machine at rest."""
    return pose, np.zeros_like(pose), np.zeros_like(pose)


class PathPlanner:
    """A planner of motions between states.

    Args:
        model: Model of the robot, for torques and distances.
        trajectories: Trajectories with the limits: speeds and accelerations use half of their limits, positions,
            torques, powers and bounds all of theirs.
    """

    def __init__(self, model: Model, trajectories: Trajectories) -> None:
        self._model, self._trajectories = model, trajectories
        self._limits = trajectories.limits
        self._coordinates = Coordinates(model.mechanism)
        self._quantities = Quantities(model.mechanism, trajectories.constraints)

    def plan(self, start: State, end: State) -> list[Segment]:
        """Return one segment, or several through poses in between.

        Raises:
            DataError: No path was found; the message says what is in the way of the straight one.
        """
        try:
            return [self._plan_straight(start, end)]
        except _NoPathError as error:
            standing = all(self._can_stand(state[0]) for state in (start, end))
            found = self._plan_detour(start, end) if standing else []
            if not found:
                raise DataError(str(error)) from None
            return found

    def _plan_detour(self, start: State, end: State) -> list[Segment]:
        """Return the shortest detour found through clear poses, or nothing if all tries fail [Bohlin2000]."""
        states = [start, end, *map(make_rest_state, self._sample_poses(start[0], end[0]))]
        poses = np.array([state[0] for state in states])
        moves = np.abs(poses[:, None] - poses) / self._limits.velocity
        lengths = np.max(moves, axis=2) ** _MANY_SHORT
        lengths[0, 1] = lengths[1, 0] = np.inf
        clear: dict[tuple[int, int], Segment] = {}
        for _ in range(_TRIED):
            total, before = dijkstra(lengths, indices=0, return_predecessors=True)
            if np.isinf(total[1]):
                return []
            path = [1]
            while path[-1] != 0:
                path.append(int(before[path[-1]]))
            pairs = list(itertools.pairwise(reversed(path)))
            for one, other in pairs:
                if (one, other) in clear:
                    continue
                try:
                    clear[one, other] = self._plan_straight(states[one], states[other])
                except _NoPathError:
                    lengths[one, other] = lengths[other, one] = np.inf
                    break
            else:
                return [clear[leg] for leg in pairs]
        return []

    def _sample_poses(self, position: FloatArray, other: FloatArray) -> Iterator[FloatArray]:
        """Yield collision-free poses, the same at every call: first near the midpoint of two poses, then farther away."""
        rng = np.random.default_rng(0)
        limits = self._limits
        for k in range(_POSES):
            spread = _FARTHEST * limits.reach * (k + 1) / _POSES
            pose = (position + other) / 2 + spread * rng.normal(size=position.size)
            pose = np.clip(pose, limits.lower, limits.upper)
            if self._find_violated_bound(pose[None]) is None:
                yield pose

    def _plan_straight(self, start: State, end: State) -> Segment:
        """Return the straight segment with the shortest of several durations that keeps the limits.

        Raises:
            _NoPathError: Every duration exceeds a limit, or something is in the way.
        """
        limits = self._limits
        fast = np.maximum(_GENTLE * limits.velocity, np.abs([start[1], end[1]]).max(axis=0))
        hard = np.maximum(_GENTLE * limits.acceleration, np.abs([start[2], end[2]]).max(axis=0))
        duration = _SHORTEST
        while duration < _LONGEST:
            segment = Segment(duration, _fit_quintic(start, end, duration))
            z, dz, ddz = segment.compute_states(np.linspace(0, duration, _CHECKED))
            slow = (np.abs(dz) <= fast * (1 + _ROUNDING)) & (np.abs(ddz) <= hard * (1 + _ROUNDING))
            if self._is_inside(z) and slow.all():
                name = self._find_violated_bound(z)
                if name is not None:
                    raise _NoPathError(
                        f"the move from trajectories.start_pose to the trajectory violates the bounds of {name}; choose another pose."
                    )
                if self._is_loadable(z, dz, ddz):
                    return segment
            duration *= _LONGER
        raise _NoPathError(
            "no move from trajectories.start_pose to the trajectory keeps the limits; choose another "
            "pose within the position limits, or trajectories.rest_to_rest."
        )

    def _can_stand(self, pose: FloatArray) -> bool:
        """Whether a pose is within the limits and can be held; else no detour helps."""
        z, still = pose[None], np.zeros((1, pose.size))
        inside = self._is_inside(z)
        return (
            inside and self._find_violated_bound(z) is None and self._is_loadable(z, still, still)
        )

    def _is_inside(self, z: FloatArray) -> bool:
        """Return whether all positions are within their limits."""
        limits = self._limits
        inside = (z >= limits.lower - _ROUNDING) & (z <= limits.upper + _ROUNDING)
        return bool(inside.all())

    def _find_violated_bound(self, z: FloatArray) -> str | None:
        """Return the name of a bound that a motion violates, or None."""
        quantities = self._quantities
        if not quantities.constraints:
            return None
        try:
            rows = quantities.compute_rows(self._coordinates.compute_positions(z, None))
        except DataError as error:
            return str(error)
        if rows.max() <= 0:
            return None
        worst = int(np.argmax(rows.max(axis=0)))
        return quantities.constraints[quantities.owners[worst]].name

    def _is_loadable(self, z: FloatArray, dz: FloatArray, ddz: FloatArray) -> bool:
        """Whether torques and powers of the model with the values in the config keep to their limits."""
        limits = self._limits
        if not (np.isfinite(limits.torque).any() or np.isfinite(limits.power).any()):
            return True
        q = self._coordinates.compute_positions(z, None)
        states = (q, *self._coordinates.compute_rates(q, dz, ddz))
        tau = self._dynamics.compute_regressor(*states) @ self._model.values
        slack = 1 + _ROUNDING
        kept = (np.abs(tau) <= limits.torque * slack) & (np.abs(tau * dz) <= limits.power * slack)
        return bool(kept.all())

    @cached_property
    def _dynamics(self) -> Dynamics:
        return Dynamics(self._model.mechanism)


def _fit_quintic(start: State, end: State, duration: float) -> FloatArray:
    """Return the coefficients of quintic polynomials between two states, (6, n_dof), of time from 0 to 1."""
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
