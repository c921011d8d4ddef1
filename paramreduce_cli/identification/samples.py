"""Measured motions as a sample set: torques and observation matrix through one low-pass."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from operator import attrgetter

import numpy as np

from paramreduce_cli.identification import filters
from paramreduce_cli.identification.processing import UNUSED
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.observation import (
    BLOCK_SAMPLES,
    ObservedSet,
    Span,
    StateBlock,
    joint_factors,
    spans,
)
from paramreduce_cli.records import Block, FloatArray, IntArray, MeasuredLog, MeasuredMotions

_STATES = ("time", "z", "dz", "ddz", "q", "dq", "ddq")


@dataclass
class LoggedSet:
    """Samples of measured motions, computed as they are read; folds are their trajectories.

    Where torques pass a low-pass, every column of the observation matrix passes the same one, so that
    the model stays linear and exact [Gautier1997]; states are those at the sample's own time.
    """

    motions: MeasuredMotions
    log: MeasuredLog
    """For the low-pass."""
    dynamics: Dynamics
    source: str
    """What the states are, for messages."""

    def __post_init__(self) -> None:
        self._taps = filters.low_pass(self.log.torque_cutoff, self.log.rate)
        self._every = round(self.log.rate / self.log.output_rate)
        self._first = np.searchsorted(self.motions.piece, np.unique(self.motions.piece))

        present = [
            self.motions.fold[self._rows(k)][self._outputs(k)] for k in range(self._first.size)
        ]
        # Folds of which the low-pass leaves nothing are none.
        numbers = np.unique(np.concatenate([np.zeros(0, np.int64), *present]))
        self._folds = {int(fold): k for k, fold in enumerate(numbers)}

    @property
    def n_samples(self) -> int:
        """How many samples it yields in all."""
        return sum(self._outputs(k).size for k in range(self._first.size))

    @property
    def recomputable(self) -> bool:
        """Not what passed a low-pass."""
        return self._taps.size == 1

    def _rows(self, piece: int) -> slice:
        ends = [*self._first.tolist(), self.motions.time.size]
        return slice(ends[piece], ends[piece + 1])

    def _outputs(self, piece: int) -> IntArray:
        """Samples of a piece that are used and have all the neighbours that the low-pass needs."""
        fold = self.motions.fold[self._rows(piece)]
        used = np.flatnonzero(fold != UNUSED)
        k = self._taps.size // 2
        picked = used[:: self._every]
        result: IntArray = picked[(picked >= k) & (picked < fold.size - k)]
        return result

    def blocks(self) -> Iterator[Block]:
        """Yield the samples in order; every call starts anew."""
        ends = [*self._first.tolist(), self.motions.time.size]
        observed = ObservedSet(
            spans(np.diff(ends).tolist()), self._states_at, self.dynamics,
            np.zeros(self.dynamics.mechanism.n_parameters), self.source,
        )  # fmt: skip
        for piece, blocks in groupby(observed.blocks(), attrgetter("trajectory")):
            yield from self._low_passed(piece, blocks)

    def states(self) -> Iterator[StateBlock]:
        """Yield states and low-passed torques of the samples alone."""
        m = self.motions
        k = self._taps.size // 2
        for piece in range(self._first.size):
            outputs = self._outputs(piece)
            first = self._rows(piece).start
            for start in range(0, outputs.size, BLOCK_SAMPLES):
                some = outputs[start : start + BLOCK_SAMPLES]
                needed = slice(int(some[0]) - k, int(some[-1]) + k + 1)
                rows = m.tau[first + needed.start : first + needed.stop]
                tau = filters.thinned_low_pass(rows, needed.start, self._taps, some)
                at = first + some
                yield StateBlock(piece, m.time[at], m.z[at], m.dz[at], m.ddz[at], tau)

    def _states_at(self, span: Span) -> StateBlock:
        """States, also those that only serve the low-pass, and torques as measured."""
        m, first = self.motions, self._rows(span.trajectory).start
        part = slice(first + span.start, first + span.stop)
        states = m.time[part], m.z[part], m.dz[part], m.ddz[part]
        return StateBlock(span.trajectory, *states, m.tau[part])

    def _low_passed(self, piece: int, blocks: Iterator[Block]) -> Iterator[Block]:
        """Blocks of the samples that are used; only what the low-pass still needs is held."""
        waiting = self._outputs(piece)
        fold = self.motions.fold[self._rows(piece)]
        k = self._taps.size // 2
        held: list[Block] = []
        first = 0
        end = 0
        for block in blocks:
            held.append(block)
            end += block.time.size
            count = int(np.searchsorted(waiting, end - k))
            ready, waiting = waiting[:count], waiting[count:]
            for number in np.unique(fold[ready]).tolist():
                yield self._made(held, first, ready[fold[ready] == number], self._folds[number])
            needed = int(waiting[0]) - k if waiting.size else end
            while held and first + held[0].time.size <= needed:
                first += held.pop(0).time.size

    def _made(self, held: list[Block], first: int, outputs: IntArray, fold: int) -> Block:
        def joined(key: str) -> FloatArray:
            return np.concatenate([getattr(block, key) for block in held])

        tau = joined("tau")
        n_rows, n_dof = tau.shape
        states = {key: joined(key)[outputs - first] for key in _STATES}
        W = joined("W").reshape(n_rows, -1)
        if self._taps.size == 1:
            W, tau = W[outputs - first], tau[outputs - first]
        else:
            W = filters.thinned_low_pass(W, first, self._taps, outputs)
            tau = filters.thinned_low_pass(tau, first, self._taps, outputs)
        return Block(trajectory=fold, tau=tau, W=W.reshape(outputs.size * n_dof, -1), **states)

    def factors(self) -> FloatArray:
        """Triangular factors per fold and joint."""
        return joint_factors(self.blocks())
