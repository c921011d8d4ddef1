"""Observation matrices of long motions, block by block, compressed to triangular factors.

The triangular factor R of [W | tau] has the same least-squares fits as the matrix itself;
one is kept for every trajectory and joint, so that any weighting of joints and any choice
of trajectories follows from the factors alone.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from paramreduce_cli.errors import DataError
from paramreduce_cli.records import Block, FloatArray

if TYPE_CHECKING:
    from paramreduce_cli.multibody.dynamics import Dynamics
    from paramreduce_cli.multibody.loops.coordinates import Coordinates

BLOCK_SAMPLES = 150
"""Samples evaluated at a time: small enough for the cache, large enough for the loops."""
PIECE_SAMPLES = 60_000
"""Samples of a piece of a long trajectory, a multiple of the former."""
_FACTORISED_AT_ONCE = 600
"""Samples: the factor found so far is worked into again each time."""


@dataclass(frozen=True)
class StateBlock:
    """A block of consecutive states of one trajectory, with torques if they were measured."""

    trajectory: int
    time: FloatArray
    z: FloatArray
    dz: FloatArray
    ddz: FloatArray
    tau: FloatArray | None = None
    fine_positions: FloatArray | None = None
    """Positions z on a grid several times finer, on which loops are followed, (m n_samples, n_dof)."""


@dataclass(frozen=True)
class Span:
    """A span of consecutive samples of one trajectory, few enough to be evaluated at once."""

    trajectory: int
    start: int
    stop: int


StatesAt = Callable[[Span], StateBlock]
"""Gives the states of a span."""


def make_spans(lengths: Iterable[int]) -> list[Span]:
    """Return spans of all samples of trajectories of some lengths, in order."""
    return [
        Span(trajectory, start, min(start + BLOCK_SAMPLES, length))
        for trajectory, length in enumerate(lengths)
        for start in range(0, length, BLOCK_SAMPLES)
    ]


@dataclass
class ObservedSet:
    """A sample set computed from states as it is read."""

    spans: list[Span]
    """Spans of the trajectories in the set."""
    at: StatesAt
    """The states of a span."""
    dynamics: Dynamics
    phi: FloatArray
    """Standard parameters, for torques that were not measured."""
    source: str
    """Source of the states, for messages."""
    divisible: bool = False
    """Whether a piece may begin within a trajectory, whose factor is then the same to round-off alone."""
    recomputable = True

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return sum(span.stop - span.start for span in self.spans)

    def iterate_states(self) -> Iterator[StateBlock]:
        """Yield the states in order; every call starts anew."""
        return map(self.at, self.spans)

    def iterate_pieces(self) -> Iterator[ObservedSet]:
        """Yield the set in pieces of limited size."""
        most = PIECE_SAMPLES // BLOCK_SAMPLES if self.divisible else len(self.spans)
        for _, own in itertools.groupby(self.spans, lambda span: span.trajectory):
            rest = list(own)
            for start in range(0, len(rest), most):
                yield replace(self, spans=rest[start : start + most])

    @cached_property
    def _coordinates(self) -> Coordinates:
        # Late: all kinds of mechanisms, of which looking at a file needs nothing.
        """Map from the independent coordinates to all of them."""
        from paramreduce_cli.multibody.loops.coordinates import Coordinates

        return Coordinates(self.dynamics.mechanism)

    def iterate_blocks(self) -> Iterator[Block]:
        """Yield the samples in order; every call starts anew.

        Raises:
            DataError: The loops cannot be closed throughout a trajectory.
        """
        nothing = np.empty(0), np.empty((0, self.dynamics.mechanism.n_q))
        trajectory, before = -1, nothing
        for s in self.iterate_states():
            if s.trajectory != trajectory:
                trajectory, before = s.trajectory, nothing
            try:
                q, before = self._follow(s, before)
            except DataError as error:
                raise DataError(f"{self.source}, trajectory {trajectory + 1}: {error}") from error
            dq, ddq = self._coordinates.compute_rates(q, s.dz, s.ddz)
            K = self.dynamics.compute_regressor(q, dq, ddq)
            tau = K @ self.phi if s.tau is None else s.tau
            W = K.reshape(-1, K.shape[2])
            yield Block(s.trajectory, s.time, s.z, s.dz, s.ddz, tau, q, dq, ddq, W)

    def _follow(
        self, s: StateBlock, before: tuple[FloatArray, FloatArray]
    ) -> tuple[FloatArray, tuple[FloatArray, FloatArray]]:
        """Return the generalised coordinates of a block, and the time and position of its last point, from which the
        next block is followed. Without loops, return the time and position unchanged.
        """
        if self.dynamics.mechanism.loops is None:
            return s.z, before
        positions = s.z if s.fine_positions is None else s.fine_positions
        finer = positions.shape[0] // s.z.shape[0]
        steps = np.arange(positions.shape[0]) / finer
        time = np.interp(steps, np.arange(s.time.size), s.time)
        q = self._coordinates.compute_positions(positions, before[1][0] if before[1].size else None)
        times, path = np.concatenate([before[0], time]), np.concatenate([before[1], q])
        self._coordinates.check_motion(times, path)
        return q[::finer], (time[-1:], q[-1:])

    def compute_factors(self) -> FloatArray:
        """Return the triangular factors by trajectory and joint."""
        return compute_joint_factors(self.iterate_blocks())


class FactorAccumulator:
    """An accumulator of the triangular factors of blocks, by trajectory and joint."""

    def __init__(self) -> None:
        self._factors: dict[int, list[FloatArray]] = {}
        self._waiting: list[Block] = []

    def add(self, block: Block) -> None:
        """Add the rows of one block."""
        if self._waiting and self._waiting[0].trajectory != block.trajectory:
            self._factorise()
        self._waiting.append(block)
        if sum(waiting.time.size for waiting in self._waiting) >= _FACTORISED_AT_ONCE:
            self._factorise()

    def _factorise(self) -> None:
        """Compress the collected rows into the factors."""
        first = self._waiting[0]
        n_dof, n = first.tau.shape[1], first.W.shape[1]
        factors = self._factors.setdefault(first.trajectory, [np.zeros((0, n + 1))] * n_dof)
        W = [block.W.reshape(-1, n_dof, n) for block in self._waiting]
        count = sum(len(w) for w in W)
        for j, factor in enumerate(factors):
            stacked = np.empty((len(factor) + count, n + 1))  # copied once: a tenth of the time
            stacked[: len(factor)] = factor
            start = len(factor)
            for w, block in zip(W, self._waiting, strict=True):
                rows = stacked[start : start + len(w)]
                rows[:, :n], rows[:, n] = w[:, j], block.tau[:, j]
                start += len(w)
            factors[j] = _reduce(stacked)
        self._waiting = []

    def get_factors(self) -> FloatArray:
        """Return the factors, (n_trajectories, n_dof, n + 1, n + 1), from the first trajectory that has samples to the
        last, padded with zero rows; without trajectories if there were no blocks.
        """
        if self._waiting:
            self._factorise()
        if not self._factors:
            return np.zeros((0, 0, 0, 0))
        some = next(iter(self._factors.values()))
        none = [np.zeros((0, factor.shape[1])) for factor in some]
        numbers = range(min(self._factors), max(self._factors) + 1)
        return np.array(
            [[_make_square(factor) for factor in self._factors.get(k, none)] for k in numbers]
        )


def compute_joint_factors(blocks: Iterable[Block]) -> FloatArray:
    """Return the triangular factors of [W | tau] by trajectory and joint.

    Returns:
        (n_trajectories, n_dof, n_parameters + 1, n_parameters + 1)
    """
    accumulator = FactorAccumulator()
    for block in blocks:
        accumulator.add(block)
    return accumulator.get_factors()


def join_factors(parts: Iterable[tuple[int, FloatArray]]) -> FloatArray:
    """Return the triangular factors of all rows, given those of parts of the rows.

    Args:
        parts: Consecutive parts of the samples: number of the first trajectory, and the factors from it on, (n_trajectories, n_dof, k, k).

    Returns:
        (n_trajectories, n_dof, k, k); what only one part holds is what it was there.
    """
    found: dict[int, FloatArray] = {}
    for first, factors in parts:
        for number, more in enumerate(factors, first):
            own = found.get(number)
            if own is None:
                found[number] = more
            else:
                found[number] = np.array(
                    [_make_square(np.vstack(rows)) for rows in zip(own, more, strict=True)]
                )
    return (
        np.array([found[number] for number in sorted(found)]) if found else np.zeros((0, 0, 0, 0))
    )


def append_rows(factor: FloatArray, rows: FloatArray) -> FloatArray:
    """Return the triangular factor of [factor; rows]."""
    return _reduce(np.vstack([factor, rows]))


def _reduce(stacked: FloatArray) -> FloatArray:
    """Return the triangular factor of rows, or the rows themselves if they are few."""
    return _factorise(stacked) if stacked.shape[0] > stacked.shape[1] else stacked


def _factorise(rows: FloatArray) -> FloatArray:
    """Return the triangular factor of rows."""
    result: FloatArray = np.linalg.qr(rows, mode="r")  # type: ignore[assignment]
    return result


def _make_square(factor: FloatArray) -> FloatArray:
    """Return the triangular factor as a square matrix, padded with zero rows."""
    size = factor.shape[1]
    triangular = _factorise(factor)
    result = np.zeros((size, size))
    result[: triangular.shape[0]] = triangular
    return result


def combine_factors(factors: FloatArray, nominal_torque: FloatArray | None) -> FloatArray:
    """Return the triangular factor of all rows together; the rows of each joint are divided by its nominal torque.

    Args:
        factors: Factors by trajectory and joint, (n_trajectories, n_dof, k, k).
        nominal_torque: Divisors, (n_dof,), or None for no weighting.

    Returns:
        (k, k)
    """
    weighted = factors if nominal_torque is None else factors / nominal_torque[:, None, None]
    k = factors.shape[-1]
    result = np.zeros((0, k))
    for trajectory in weighted:
        result = append_rows(result, trajectory.reshape(-1, k))
    return _make_square(result)


def decimate_blocks(blocks: Iterable[Block], every: int) -> Iterator[Block]:
    """Yield the blocks with every ``every``-th sample of each trajectory alone."""
    trajectory, start = -1, 0
    for block in blocks:
        if block.trajectory != trajectory:
            trajectory, start = block.trajectory, 0
        n, n_dof = block.tau.shape
        picked = np.arange(-start % every, n, every)
        start += n
        rows = (picked[:, None] * n_dof + np.arange(n_dof)).ravel()
        states = {
            key: getattr(block, key)[picked]
            for key in ("time", "z", "dz", "ddz", "tau", "q", "dq", "ddq")
        }
        yield Block(trajectory=trajectory, W=block.W[rows], **states)


def compute_standard_deviation(arrays: Iterable[FloatArray]) -> FloatArray:
    """Return the standard deviation of the columns over all arrays together, merged pair by pair [Chan1983]."""
    count, mean, spread = 0, np.zeros(1), np.zeros(1)
    for array in arrays:
        n, own_mean = array.shape[0], array.mean(axis=0)
        step = own_mean - mean
        total = count + n
        mean = mean + step * (n / total)
        own_spread = np.sum((array - own_mean) ** 2, axis=0)
        spread = spread + own_spread + step**2 * (count * n / total)
        count = total
    return np.sqrt(spread / max(count, 1))
