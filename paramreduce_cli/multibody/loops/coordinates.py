"""Map from the independent coordinates of closed loops to all coordinates.

The position problem is solved by Newton's method for all samples at once, each followed
along the straight line from where it started, in steps that shorten where Newton's
corrections are not small against the step: a solution stays on its assembly mode.
"""

from functools import cached_property

import casadi as ca
import numpy as np

from paramreduce_cli.errors import DataError
from paramreduce_cli.expressions.compiled import BatchFunction
from paramreduce_cli.multibody.loops.projection import Projection
from paramreduce_cli.records import BoolArray, FloatArray, IntArray, Mechanism

_CONVERGED = 1e-7
"""Largest correction after which Newton's next one would be round-off (it squares), rad or m."""
_CLOSED = 1e-6
"""Largest gap before a last correction of that size, m."""
_CORRECTIONS = 6
_LARGEST_CORRECTION = 0.3
"""Share of a step that Newton may correct; more, and it might fall on another assembly mode."""
_LONGEST_STEP = 0.6
"""Sum of the largest moves of independent and dependent coordinates in one step, rad or m."""
_SHORTEST_STEP = 1 / 512
_SINGULAR = 1e-5
"""Distance to singularity that counts as none."""
_JUMP = 0.5
"""Share by which a step between samples may differ from what the tangents at its ends say."""
_LEADERS = 4
"""Samples of a motion from one to the next that is followed in time."""
_UNNOTICED = 1e-2
"""Difference that is no jump whatever the share, rad or m."""


class Coordinates:
    """A map from independent coordinates, velocities and accelerations to generalised ones.

    Args:
        mechanism: A tree, whose generalised coordinates are its independent ones, or one with
            assembled loops.
        once: Whether it is evaluated so little that compiling it does not pay.
    """

    def __init__(self, mechanism: Mechanism, *, once: bool = False) -> None:
        self.mechanism = mechanism
        self._once = once
        self._independent = list(mechanism.independent)
        self._dependent = list(mechanism.dependent)

    @cached_property
    def _projection(self) -> Projection:
        return Projection(self.mechanism)

    def _compile(self, *outputs: ca.MX) -> BatchFunction:
        """Return the compiled function of q that gives some expressions."""
        return BatchFunction([self._projection.q], list(outputs), once=self._once)

    @cached_property
    def _newton(self) -> BatchFunction:
        """Compiled gap of the closures, and Newton's step."""
        loop = self._projection
        return self._compile(loop.gap, -loop.solve(loop.gap))

    @cached_property
    def _tangent(self) -> BatchFunction:
        return self._compile(self._projection.tangent.T)

    @cached_property
    def _distance(self) -> BatchFunction:
        return self._compile(self._projection.distance)

    @cached_property
    def _jacobian(self) -> BatchFunction:
        return self._compile(ca.densify(self._projection.dependent_jacobian).T)

    @cached_property
    def _rates(self) -> BatchFunction:
        """Compiled velocities and accelerations of all coordinates."""
        dz, ddz = (ca.MX.sym(name, self.mechanism.n_dof) for name in ("dz", "ddz"))
        outputs = list(self._projection.express_rates(dz, ddz))
        return BatchFunction([self._projection.q, dz, ddz], outputs, once=self._once)

    def compute_states(
        self, z: FloatArray, dz: FloatArray, ddz: FloatArray, start: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return all coordinates of a motion and their derivatives.

        Args:
            z: Independent coordinates, (n_samples, n_dof), rad or m.
            dz: Velocities, same shape.
            ddz: Accelerations, same shape.
            start: Generalised coordinates to start from, (n_q,) or (n_samples, n_q); the
                assembly if left out.

        Returns:
            q, dq and ddq, each (n_samples, n_q).

        Raises:
            DataError: The loops cannot be closed at a sample.
        """
        q = self.compute_positions(z, start)
        return (q, *self.compute_rates(q, dz, ddz))

    def compute_positions(self, z: FloatArray, start: FloatArray | None) -> FloatArray:
        """Return the generalised coordinates of consecutive samples of a motion, (n_samples, n_q).

        Args:
            z: Independent coordinates, (n_samples, n_dof), rad or m.
            start: Generalised coordinates to start from: one for each sample, (n_samples, n_q),
                or one that the motion is followed from, (n_q,); the assembly for None.

        Raises:
            DataError: The loops cannot be closed at a sample.
        """
        if self.mechanism.loops is None:
            return z
        near = start is not None and start.ndim == 2
        single = z.shape[0] == 1  # no motion to be followed in steps
        q, reached = self.follow(z, start) if near or single else self._march(z, start)
        self._check_reached(z, reached)
        return q

    def compute_rates(
        self, q: FloatArray, dz: FloatArray, ddz: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return velocities dq and accelerations ddq, (n_samples, n_q) each.

        Args:
            q: Generalised coordinates, (n_samples, n_q).
            dz: Velocities of the independent coordinates, (n_samples, n_dof).
            ddz: Accelerations, same shape.
        """
        if self.mechanism.loops is None:
            return dz, ddz
        dq, ddq = self._rates(q, dz, ddz)
        return dq, ddq

    def _march(self, z: FloatArray, start: FloatArray | None) -> tuple[FloatArray, FloatArray]:
        """Follow a motion from sample to sample, because a direct path to distant samples could end in another assembly
        mode. Every fourth sample is followed from the previous such sample; the samples between start from the last
        such sample before.
        """
        leaders = np.arange(0, z.shape[0], _LEADERS)
        known = np.empty((leaders.size, self.mechanism.n_q))
        for k, leader in enumerate(leaders):
            q, reached = self.follow(z[leader : leader + 1], start)
            if reached[0] < 1:
                fraction = np.where(np.arange(z.shape[0]) < leader, 1.0, reached[0])
                return np.empty((z.shape[0], self.mechanism.n_q)), fraction
            known[k] = start = q[0]
        return self.follow(z, known[np.arange(z.shape[0]) // _LEADERS])

    def follow(self, z: FloatArray, start: FloatArray | None) -> tuple[FloatArray, FloatArray]:
        """Move every sample from a known position towards its target, with the loops closed.

        Args:
            z: Independent coordinates to reach, (n_samples, n_dof).
            start: Generalised coordinates with closed loops, (n_q,) or (n_samples, n_q).

        Returns:
            Where each sample came, with closed loops, (n_samples, n_q), and the share of the
            way it made, (n_samples,); 1 where it arrived.
        """
        assert self.mechanism.loops is not None
        begin = self.mechanism.loops.assembly if start is None else start
        q = np.array(np.broadcast_to(begin, (z.shape[0], self.mechanism.n_q)))
        displacement = z - q[:, self._independent]
        made, step = np.zeros(z.shape[0]), np.ones(z.shape[0])
        active = np.arange(z.shape[0])
        while active.size:
            length = np.minimum(step[active], 1 - made[active])
            new, good = self._advance(q[active], displacement[active] * length[:, None])
            moved = active[good]
            q[moved] = new[good]
            made[moved] += length[good]
            step[moved] *= 2
            step[active[~good]] = length[~good] / 2
            made[made > 1 - 1e-12] = 1.0
            active = active[(made[active] < 1) & (step[active] >= _SHORTEST_STEP)]
        arrived = np.flatnonzero(made == 1)
        q[arrived[:, None], self._independent] = z[arrived]
        return q, made

    def _check_reached(self, z: FloatArray, reached: FloatArray) -> None:
        """Raise DataError if a sample did not reach its target."""
        if (reached == 1).all():
            return
        worst = int(np.argmin(reached))
        names = self.mechanism.coordinate_names
        there = ", ".join(f"{n} = {v:.4g}" for n, v in zip(names, z[worst], strict=True))
        raise DataError(
            f"the loops cannot be closed at {there}: on the way there from the nearest known "
            "position the mechanism comes to a singular configuration or to the end of its reach. "
            "Keep the motion away from there, by its limits or by constraints."
        )

    def compute_tangent(self, q: FloatArray) -> FloatArray:
        """Return R = dq/dz, (n_samples, n_q, n_dof), at q, (n_samples, n_q)."""
        n_dof = len(self._independent)
        R = np.zeros((q.shape[0], self.mechanism.n_q, n_dof))
        R[:, self._independent] = np.eye(n_dof)
        if self._dependent:
            R[:, self._dependent] = self._tangent(q)[0].reshape(q.shape[0], -1, n_dof)
        return R

    def check_motion(self, time: FloatArray, q: FloatArray) -> None:
        """Raise DataError if the loops do not determine the dependent coordinates at a sample of a motion, or between
        two consecutive samples.

        Args:
            time: Time of consecutive samples, (n_samples,), s.
            q: Generalised coordinates, (n_samples, n_q).

        Raises:
            DataError: The motion comes to or passes a singular configuration, or jumps to another assembly mode.
        """
        if self.mechanism.loops is None:
            return
        near = np.flatnonzero(self.compute_distance(q) < _SINGULAR)
        if near.size:
            raise DataError(
                f"the motion comes to a singular configuration of the loops at t = "
                f"{time[near[0]]:.4g} s, where {', '.join(self.mechanism.coordinate_names)} do not "
                "determine the other coordinates. Keep away from it with a constraint on the distance "
                "to singularity."
            )
        sign = self._compute_side(q)
        tangent = self.compute_tangent(q)
        z = q[:, self._independent]
        step = np.diff(q, axis=0)
        middle = (tangent[1:] + tangent[:-1]) / 2
        expected = np.einsum("kij,kj->ki", middle, np.diff(z, axis=0))
        missed = np.abs(step - expected).max(axis=1)
        jump = missed > _JUMP * np.abs(expected).max(axis=1) + _UNNOTICED
        wrong = np.flatnonzero(jump | (sign[1:] != sign[:-1]))
        if wrong.size:
            k = int(wrong[0])
            raise DataError(
                f"between t = {time[k]:.4g} s and {time[k + 1]:.4g} s the loops pass through a "
                "singular configuration or change their assembly mode. Keep the motion away from "
                "there, or sample it more densely."
            )

    def check_side(self, z: FloatArray, q: FloatArray) -> None:
        """Raise DataError if a position is separated from the assembly by a singular configuration.

        Raises:
            DataError: The determinant of Phi_d has the other sign at a sample.
        """
        beyond = self._compute_side(q) != self._assembly_side
        self._check_reached(z, np.where(beyond, 0.5, 1.0))

    def _compute_side(self, q: FloatArray) -> FloatArray:
        """Return the sign of the determinant of Phi_d, (n_samples,)."""
        n_d = len(self._dependent)
        sign: FloatArray = np.linalg.slogdet(self._jacobian(q)[0].reshape(-1, n_d, n_d))[0]
        return sign

    @cached_property
    def _assembly_side(self) -> float:
        """Sign of the determinant of Phi_d at the assembly."""
        assert self.mechanism.loops is not None
        return float(self._compute_side(self.mechanism.loops.assembly[None])[0])

    def compute_distance(self, q: FloatArray) -> FloatArray:
        """Return the distance to singularity of the loops, 0 to 1, (n_samples,); see :class:`Projection`."""
        return np.nan_to_num(self._distance(q)[0][:, 0], nan=0.0)

    def _advance(self, q: FloatArray, dz: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Take one predicted step with its corrections; return False where it cannot be trusted."""
        (tangent,) = self._tangent(q)
        shape = (q.shape[0], len(self._dependent), len(self._independent))
        predicted = np.einsum("kij,kj->ki", tangent.reshape(shape), dz)
        new = q.copy()
        new[:, self._independent] += dz
        new[:, self._dependent] += predicted
        size = np.abs(predicted).max(axis=1, initial=0.0) + np.abs(dz).max(axis=1)
        total = np.zeros_like(predicted)
        good = np.zeros(q.shape[0], dtype=bool)
        todo: IntArray = np.flatnonzero(size <= _LONGEST_STEP)
        for _ in range(_CORRECTIONS):
            gap, correction = self._newton(new[todo])
            with np.errstate(invalid="ignore"):
                total[todo] += correction
                largest = np.abs(correction).max(axis=1)
                small = np.abs(total[todo]).max(axis=1) <= _LARGEST_CORRECTION * size[todo] + 1e-6
            new[todo[:, None], self._dependent] += correction
            arrived = small & (largest <= _CONVERGED) & (np.abs(gap).max(axis=1) <= _CLOSED)
            good[todo[arrived]] = True
            todo = todo[small & ~arrived]
            if not todo.size:
                break
        return new, good
