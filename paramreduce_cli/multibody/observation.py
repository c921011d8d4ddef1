"""Observation matrices of long motions, block by block, compressed as they pass.

The triangular factor R of [W | tau] has the same least-squares fits as the matrix itself;
one is kept for every trajectory and joint, so that any weighting of joints and any choice
of trajectories follows from the factors alone.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.errors import DataError
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.records import Block, FloatArray

BLOCK_SAMPLES = 150
"""Samples evaluated at a time: small enough for the cache, large enough for the loops."""


@dataclass(frozen=True)
class StateBlock:
    """Consecutive states of one trajectory, and torques where they were measured."""

    trajectory: int
    time: FloatArray
    z: FloatArray
    dz: FloatArray
    ddz: FloatArray
    tau: FloatArray | None = None
    way: FloatArray | None = None
    """Positions z on a grid several times finer, on which loops are followed, (m n_samples, n_dof)."""


class ObservedSet:
    """A sample set computed from states as it is read.

    Args:
        states: Called to start reading anew.
        n_samples: How many samples it yields in all.
        dynamics: Of the mechanism.
        phi: Standard parameters, for torques that were not measured.
        source: What the states are, for messages.
    """

    def __init__(
        self,
        states: Callable[[], Iterable[StateBlock]],
        n_samples: int,
        dynamics: Dynamics,
        phi: FloatArray,
        source: str,
    ) -> None:
        self._source = source
        self.states = states
        self.n_samples = n_samples
        self._coordinates = Coordinates(dynamics.mechanism)
        self._dynamics = dynamics
        self._phi = phi

    def blocks(self) -> Iterator[Block]:
        """Yield the samples in order; every call starts anew.

        Raises:
            DataError: The loops cannot be closed throughout a trajectory.
        """
        before: tuple[FloatArray, FloatArray] | None = None
        trajectory = -1
        for s in self.states():
            if s.trajectory != trajectory:
                trajectory, before = s.trajectory, None
            try:
                q, before = self._followed(s, before)
            except DataError as error:
                raise DataError(f"{self._source}, trajectory {trajectory + 1}: {error}") from error
            dq, ddq = self._coordinates.rates(q, s.dz, s.ddz)
            K = self._dynamics.regressor(q, dq, ddq)
            tau = K @ self._phi if s.tau is None else s.tau
            W = K.reshape(-1, K.shape[2])
            yield Block(s.trajectory, s.time, s.z, s.dz, s.ddz, tau, q, dq, ddq, W)

    def _followed(
        self, s: StateBlock, before: tuple[FloatArray, FloatArray] | None
    ) -> tuple[FloatArray, tuple[FloatArray, FloatArray]]:
        """Generalised coordinates of a block, and where it ends, to go on from there."""
        if self._dynamics.mechanism.loops is None:
            return s.z, (s.time[-1:], s.z[-1:])
        way = s.z if s.way is None else s.way
        finer = way.shape[0] // s.z.shape[0]
        steps = np.arange(way.shape[0]) / finer
        time = np.interp(steps, np.arange(s.time.size), s.time)
        q = self._coordinates.positions(way, None if before is None else before[1][0])
        if before is None:
            self._coordinates.check_motion(time, q)
        else:
            self._coordinates.check_motion(
                np.concatenate([before[0], time]), np.concatenate([before[1], q])
            )
        return q[::finer], (time[-1:], q[-1:])

    def factors(self) -> FloatArray:
        """Triangular factors per trajectory and joint."""
        return joint_factors(self.blocks())


class FactorAccumulator:
    """Collects the triangular factors of blocks as they pass by."""

    def __init__(self) -> None:
        self._factors: list[list[FloatArray]] = []

    def add(self, block: Block) -> None:
        """Take the rows of one block in."""
        n_dof = block.tau.shape[1]
        n = block.W.shape[1]
        while len(self._factors) <= block.trajectory:
            self._factors.append([np.zeros((0, n + 1)) for _ in range(n_dof)])
        W = block.W.reshape(-1, n_dof, n)
        for j in range(n_dof):
            rows = np.column_stack([W[:, j], block.tau[:, j]])
            factors = self._factors[block.trajectory]
            factors[j] = append_rows(factors[j], rows)

    def result(self) -> FloatArray:
        """(n_trajectories, n_dof, n + 1, n + 1), padded with zero rows."""
        return np.array([[_square(factor) for factor in factors] for factors in self._factors])


def joint_factors(blocks: Iterable[Block]) -> FloatArray:
    """Triangular factors of [W | tau] per trajectory and joint.

    Returns:
        (n_trajectories, n_dof, n_parameters + 1, n_parameters + 1)
    """
    accumulator = FactorAccumulator()
    for block in blocks:
        accumulator.add(block)
    return accumulator.result()


def append_rows(factor: FloatArray, rows: FloatArray) -> FloatArray:
    """Triangular factor of [factor; rows]."""
    stacked = np.vstack([factor, rows])
    return _triangular(stacked) if stacked.shape[0] > stacked.shape[1] else stacked


def _triangular(rows: FloatArray) -> FloatArray:
    result: FloatArray = np.linalg.qr(rows, mode="r")  # type: ignore[assignment]
    return result


def _square(factor: FloatArray) -> FloatArray:
    size = factor.shape[1]
    triangular = _triangular(factor)
    result = np.zeros((size, size))
    result[: triangular.shape[0]] = triangular
    return result


def combined_factor(factors: FloatArray, nominal_torque: FloatArray | None) -> FloatArray:
    """Triangular factor of all rows together, each joint's divided by its nominal torque.

    Args:
        factors: Per trajectory and joint, (n_trajectories, n_dof, k, k).
        nominal_torque: (n_dof,), or None for no weighting.

    Returns:
        (k, k)
    """
    weighted = factors if nominal_torque is None else factors / nominal_torque[:, None, None]
    k = factors.shape[-1]
    result = np.zeros((0, k))
    for trajectory in weighted:
        result = append_rows(result, trajectory.reshape(-1, k))
    return _square(result)


def thinned_blocks(blocks: Iterable[Block], every: int) -> Iterator[Block]:
    """Every so many samples of each trajectory."""
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


def standard_deviation(arrays: Iterable[FloatArray]) -> FloatArray:
    """Of the columns over all arrays together, merged pair by pair [Chan1983]."""
    count, mean, spread = 0, np.zeros(0), np.zeros(0)
    for array in arrays:
        n = array.shape[0]
        own_mean = array.mean(axis=0)
        own_spread = np.sum((array - own_mean) ** 2, axis=0)
        if count == 0:
            count, mean, spread = n, own_mean, own_spread
            continue
        step = own_mean - mean
        total = count + n
        mean = mean + step * (n / total)
        spread = spread + own_spread + step**2 * (count * n / total)
        count = total
    return np.sqrt(spread / max(count, 1))
