"""Evaluation of pruned programs on whole sets, and on random states inside the limits."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, groupby

import numpy as np

from paramreduce_cli.errors import DataError
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.observation import decimate_blocks
from paramreduce_cli.multibody.states_inside import States, StatesInside
from paramreduce_cli.records import (
    Block,
    Constraint,
    FloatArray,
    JointLimits,
    Model,
    Samples,
    SampleSet,
)
from paramreduce_cli.terms.descent import Simplified
from paramreduce_cli.terms.fit_samples import TermSamples, compute_joint_errors, make_samples
from paramreduce_cli.terms.program_fitting import Budget

_TORQUES = 10_000
"""Random states on which torques are compared with those of the full model."""
_MASSES = 100_000
"""Random states on which mass matrices are looked at."""
_OF_LOOPS = 1000
"""Random states of loops, for both: these have to be assembled."""
_AT_ONCE = 2000
"""At once of them at a time."""
_KNOWN = 2000
"""Samples of the estimation set from which those of loops are reached."""
_JUDGED = 20_000
"""Samples of a set, evenly spread, that programs are judged on: more of them tell no more."""
_BLOCKS = 16
"""Blocks of samples that are judged together."""
_NONE = (np.nan, np.nan)

Errors = tuple[float, float]
"""Errors of torques and of accelerations."""


@dataclass(frozen=True)
class Deviation:
    """The deviation of torques and accelerations from the full model's, away from the sets."""

    torque_error: float
    """Torque error on random states; NaN if there are none, or the torques are not known there."""
    acceleration_error: float
    """The same; not a number for the inverse dynamics either."""
    states: int
    """Number of these random states; with none, what follows is on both sets."""
    largest: FloatArray
    """Difference of each joint's torque, N m (N), (n_dof,); not a number where it was not measured."""
    worst_joint: int
    """Joint with the largest difference relative to its nominal torque."""
    worst_state: FloatArray
    """State of that difference: z, dz and ddz, (3, n_dof)."""


class Evaluator:
    """An evaluator of programs of one function.

    Args:
        model: Model of the robot.
        samples: Both sets.
        nominal_torque: Divisor of the torques of each joint, (n_dof,).
        limits: Limits of the independent coordinates; what has none is limited by what the estimation set reaches.
        constraints: Constraints that positions keep in addition.
        direct: Whether the function is [M | delta].
        projected: Whether it is of the independent coordinates of loops.
        measured: Whether torques were measured, so that those at other states are not known.
    """

    def __init__(
        self,
        model: Model,
        samples: Samples,
        nominal_torque: FloatArray,
        limits: JointLimits,
        constraints: Sequence[Constraint],
        *,
        direct: bool,
        projected: bool,
        measured: bool,
    ) -> None:
        self.direct, self.projected = direct, projected
        self._n_standard = model.values.size
        self._model, self._samples, self._nominal_torque = model, samples, nominal_torque
        self.measured = measured
        self._rng = np.random.default_rng(0)
        if samples.nominal_acceleration is None:
            raise DataError("samples.h5 holds no /nominal_acceleration.", command="sample")
        self._nominal_acceleration = samples.nominal_acceleration
        self._coordinates = Coordinates(model.mechanism, once=True)
        ranges = [
            [(x.min(axis=0), x.max(axis=0)) for x in (b.q, b.dq, b.ddq)]
            for b in samples.estimation.iterate_blocks()
        ]
        reached = np.array(ranges)[:, :, 0].min(axis=0), np.array(ranges)[:, :, 1].max(axis=0)
        self._bounds = _compute_bounds(limits, list(model.mechanism.independent), *reached)
        self._constraints = constraints
        self.lower, self.upper = (x[:, list(model.mechanism.independent)] for x in reached)
        """Smallest and largest z, dz and ddz of the estimation set, (3, n_dof) each."""

    @property
    def drawn(self) -> FloatArray:
        """Between what random states are drawn, of loops what they come to, (2, 3, n_dof); not numbers if none are looked at."""
        mechanism = self._model.mechanism
        independent = list(mechanism.independent)
        nowhere = np.full((2, 3, mechanism.n_dof), np.nan)
        if self.measured and not self.direct:
            return nowhere
        if mechanism.loops is None:
            return self._bounds[:, :, independent]
        if not self._random_sets:
            return nowhere
        every = np.hstack([part.states[: 3 * mechanism.n_q] for part in self._random_sets])
        of_joints = every.reshape(3, mechanism.n_q, -1)[:, independent]
        return np.array([of_joints.min(axis=2), of_joints.max(axis=2)])

    def decimate(self, part: SampleSet, most: int) -> TermSamples:
        """Return about ``most`` samples of a set, evenly spread within each trajectory; the number exceeds ``most`` by
        less than one sample per trajectory.
        """
        return self._make_samples(
            decimate_blocks(part.iterate_blocks(), -(-part.n_samples // most))
        )

    def _make_samples(self, blocks: Iterable[Block]) -> TermSamples:
        return make_samples(
            self._model.mechanism, blocks, self._nominal_torque,
            self._nominal_acceleration, direct=self.direct, projected=self.projected,
            coordinates=self._coordinates,
        )  # fmt: skip

    def compute_errors(self, program: Simplified) -> tuple[Errors, Errors]:
        """Return the errors on the estimation and on the validation set; NaN without such a set."""
        estimation, validation = (
            compute_joint_errors((one, program.evaluate(one.states)) for one in parts)
            if parts
            else _NONE
            for parts in self._sets
        )
        return estimation, validation

    def compute_test_errors(self, program: Simplified) -> tuple[FloatArray, FloatArray]:
        """Return the errors of torques and of accelerations on every motion of the test set, (n_motions,) each."""
        errors = [one.compute_errors(program.evaluate(one.states)) for one in self._test_motions]
        torque, acceleration = np.array(errors).reshape(-1, 2).T
        return torque, acceleration

    @cached_property
    def _test_motions(self) -> list[TermSamples]:
        """Samples of every motion of the test set."""
        part = self._samples.test
        if part is None:
            return []
        blocks = decimate_blocks(part.iterate_blocks(), -(-part.n_samples // _JUDGED))
        motions = groupby(blocks, lambda block: block.trajectory)
        return [self._make_samples(own) for _, own in motions]

    def compute_worst_ratio(self, errors: tuple[Errors, Errors], budget: Budget) -> float:
        """Return the largest error over its budget; infinite if an error is NaN.

        If torques were measured, the held-out set is left out.
        """
        no_other = self.measured or self._samples.validation is None
        kinds = 2 if self.direct else 1
        looked_at = np.array(errors[:1] if no_other else errors)[:, :kinds]
        with np.errstate(invalid="ignore"):
            shares = looked_at / (budget.torque, budget.acceleration)[:kinds]
        return float(np.nan_to_num(shares, nan=np.inf).max())

    @cached_property
    def _sets(self) -> list[list[TermSamples]]:
        """Both sets in parts."""
        result = []
        for part in (self._samples.estimation, self._samples.validation):
            blocks: list[Block] = []
            if part is not None:
                blocks = list(decimate_blocks(part.iterate_blocks(), -(-part.n_samples // _JUDGED)))
            result.append([self._make_samples(some) for some in _group_blocks(blocks)])
        return result

    def measure_deviation(self, program: Simplified) -> Deviation:
        """Return the deviation of a program on random states inside the limits; if torques were measured, on both sets
        alone.
        """
        parts = [] if self.measured else self._random_sets
        states = sum(part.states.shape[1] for part in parts)
        looked_at = parts or list(chain(*self._sets))
        outputs = [program.evaluate(part.states) for part in looked_at]
        errors = compute_joint_errors(zip(parts, outputs, strict=True)) if parts else _NONE
        off = np.abs(
            np.hstack([s.compute_residuals(o) for s, o in zip(looked_at, outputs, strict=True)])
        )
        joint, state = np.unravel_index(np.argmax((off.T / self._nominal_torque).T), off.shape)
        largest = np.where(np.isfinite(self._nominal_torque), off.max(axis=1), np.nan)
        mechanism = self._model.mechanism
        worst = np.hstack([part.states for part in looked_at])[: 3 * mechanism.n_q, state]
        of_joints = worst.reshape(3, -1)[:, list(mechanism.independent)]
        return Deviation(*errors, states, largest, int(joint), of_joints)

    @cached_property
    def _random_sets(self) -> list[TermSamples]:
        """Random states with the torques of the full model, in parts; empty if none were found."""
        dynamics = Dynamics(self._model.mechanism, once=True)
        return [
            self._make_samples(
                [self._make_block(some, dynamics.compute_torques(*some, self._model.values))]
            )
            for some in self._sample_states(_TORQUES)
        ]

    def find_smallest_eigenvalue(self, program: Simplified) -> tuple[float, int]:
        """Return the smallest eigenvalue of the mass matrices on both sets and on random states inside the limits, and
        the number of these random states.
        """
        smallest, states = np.inf, 0
        for one in chain(*self._sets, self._random_poses):
            M = one.build_mass_matrices(program.evaluate(one.states))
            smallest = min(smallest, float(np.linalg.eigvalsh(M)[:, 0].min()))
            states += len(M)
        return smallest, states - sum(one.states.shape[1] for one in chain(*self._sets))

    def sample_poses(self, count: int) -> TermSamples | None:
        """Return states inside the limits, half of them at corners if there are no loops; None if M does not matter."""
        if not self.direct:
            return None
        halves = (
            self._inside.draw(some, self._rng, corners=corners)
            for some, corners in ((count // 2, False), (count - count // 2, True))
        )
        q, dq, ddq = (np.vstack(pair) for pair in zip(*halves, strict=True))
        return self._make_samples([self._make_block((q, dq, ddq))]) if len(q) else None

    @property
    def _random_poses(self) -> Iterator[TermSamples]:
        """Random states, in portions, on which mass matrices are tested: those on which errors are computed, and for
        trees additional ones.
        """
        yield from self._random_sets
        if self._model.mechanism.loops is None:
            for some in self._sample_states(_MASSES - _TORQUES):
                yield self._make_samples([self._make_block(some)])

    @cached_property
    def _inside(self) -> StatesInside:
        """Sampler of states inside the limits and constraints."""
        part = self._samples.estimation
        blocks = decimate_blocks(part.iterate_blocks(), -(-part.n_samples // _KNOWN))
        known = np.concatenate([b.q for b in blocks])
        lower, upper = self._bounds
        return StatesInside(self._model.mechanism, lower, upper, self._constraints, known)

    def _sample_states(self, count: int) -> Iterator[States]:
        """Yield ``count`` random states in portions, for loops 1000 whatever ``count`` is.

        Fewer are yielded if constraints exclude too many states or loops are hard to assemble.
        """
        count = count if self._model.mechanism.loops is None else _OF_LOOPS
        for start in range(0, count, _AT_ONCE):
            some = self._inside.draw(min(_AT_ONCE, count - start), self._rng)
            if len(some[0]):
                yield some

    def _make_block(self, states: States, tau: FloatArray | None = None) -> Block:
        """Return a block of random states; without torques if these do not matter."""
        q, dq, ddq = states
        z, dz, ddz = (one[:, list(self._model.mechanism.independent)] for one in states)
        nothing = np.zeros((0, self._n_standard))
        tau = np.zeros_like(z) if tau is None else tau
        return Block(0, np.zeros(len(q)), z, dz, ddz, tau, q, dq, ddq, nothing)


def _compute_bounds(
    limits: JointLimits, independent: list[int], lower: FloatArray, upper: FloatArray
) -> FloatArray:
    """Return the smallest and largest q, dq and ddq of random states, (2, 3, n_q).

    Independent coordinates have their limits, or the range of the data if a limit is missing; dependent ones are at
    most as fast as in the data.
    """
    rates = np.array([limits.velocity, limits.acceleration])
    known = np.array([np.vstack([limits.lower, -rates]), np.vstack([limits.upper, rates])])
    own = np.array([lower, upper])[:, :, independent]
    # Either way, at most as fast as the set: it may have gone around loops one way only.
    fastest = np.maximum(np.abs(lower), np.abs(upper))
    fastest[0] = np.inf  # positions of loops keep to their constraints, and away from singular ones
    bounds = np.array([-fastest, fastest])
    bounds[:, :, independent] = np.where(np.isfinite(known), known, own)
    return bounds


def _group_blocks(blocks: list[Block]) -> Iterator[list[Block]]:
    for start in range(0, len(blocks), _BLOCKS):
        yield blocks[start : start + _BLOCKS]
