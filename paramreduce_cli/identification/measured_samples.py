"""Measured motions as a sample set: torques and observation matrix pass one low-pass."""

from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from operator import attrgetter

import numpy as np

from paramreduce_cli.identification import filters
from paramreduce_cli.identification.data_split import UNUSED
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.observation import (
    BLOCK_SAMPLES,
    ObservedSet,
    Span,
    StateBlock,
    compute_joint_factors,
    make_spans,
)
from paramreduce_cli.records import Block, FloatArray, IntArray, MeasuredLog, MeasuredMotions

_LOOKED_AT = 1 << 16
"""Samples that are looked at together, to see where folds begin."""
_STATES = ("time", "z", "dz", "ddz", "q", "dq", "ddq")


@dataclass(frozen=True)
class _Stretch:
    """A stretch of uninterrupted motion, and which of its samples are used."""

    first: int
    """Number of its first sample among all."""
    size: int
    outputs: range
    """Samples, counted from its first, that are used and have all the neighbours that the low-pass needs."""
    edges: IntArray
    """First sample of each fold in it."""
    folds: IntArray

    def find_folds(self, samples: IntArray) -> IntArray:
        """Return the folds of some samples."""
        found: IntArray = self.folds[np.searchsorted(self.edges, samples, side="right") - 1]
        return found


def _iterate_stretches(motions: MeasuredMotions, k: int, every: int) -> Iterator[_Stretch]:
    """Yield the uninterrupted motions, for a low-pass of 2 k + 1 taps and a decimation factor."""
    starts, pieces, folds = _find_runs(motions)
    for piece in np.unique(pieces):
        own = np.flatnonzero(pieces == piece)
        first, stop = int(starts[own[0]]), int(starts[own[-1] + 1])
        used = own[folds[own] != UNUSED]
        outputs = range(0)
        if used.size:
            begin, end = int(starts[used[0]]) - first, int(starts[used[-1] + 1]) - first
            late = max(0, -((begin - k) // every)) * every  # the first with k samples before it
            outputs = range(begin + late, min(end, stop - first - k), every)
        yield _Stretch(first, stop - first, outputs, starts[own] - first, folds[own])


def _find_runs(motions: MeasuredMotions) -> tuple[IntArray, IntArray, IntArray]:
    """Split samples into runs of constant piece and fold: return the start of each run and the end, and the piece and
    fold of each run.
    """
    total = motions.time.size
    starts, pieces, folds = [0], [], []
    for begin in range(0, total, _LOOKED_AT):
        # With the last one before, to see a change there too.
        rows = slice(max(0, begin - 1), min(begin + _LOOKED_AT, total))
        piece, fold = motions.piece[rows], motions.fold[rows]
        changes = np.flatnonzero((np.diff(piece) != 0) | (np.diff(fold) != 0)) + 1
        at = [0, *changes.tolist()] if begin == 0 else changes.tolist()
        starts += [rows.start + c for c in changes.tolist()]
        pieces += piece[at].tolist()
        folds += fold[at].tolist()
    return np.array([*starts, total]), np.array(pieces), np.array(folds)


def select_sample_of_each_fold(edges: IntArray, outputs: range) -> list[int]:
    """Return a sample of every fold that has any among some samples."""
    later = [bisect_left(outputs, int(edge)) for edge in edges]
    return sorted({outputs[k] for k in (*later, len(outputs) - 1) if 0 <= k < len(outputs)})


@dataclass
class LoggedSet:
    """A set of measured samples, computed as they are read; each fold counts as a trajectory.

    If torques are low-passed, every column of W passes the same filter, so that the model stays linear and exact
    [Gautier1997]; states are not filtered again. Only slices of the motions are read.
    """

    motions: MeasuredMotions
    log: MeasuredLog
    """Log, for its low-pass filters."""
    dynamics: Dynamics
    source: str
    """Source of the states, for messages."""
    measured: np.ndarray | None = None
    """Joints whose torques are measured, the others' are zero, (n_dof,); all if left out."""

    def __post_init__(self) -> None:
        self._taps = filters.design_low_pass(self.log.torque_cutoff, self.log.rate)
        every = round(self.log.rate / self.log.output_rate)
        self._stretches = list(_iterate_stretches(self.motions, self._taps.size // 2, every))
        ends = [
            s.find_folds(np.array(select_sample_of_each_fold(s.edges, s.outputs)))
            for s in self._stretches
        ]
        # Folds of which the low-pass leaves nothing are none.
        numbers = np.unique(np.concatenate([np.zeros(0, np.int64), *ends]))
        self._folds = {int(fold): k for k, fold in enumerate(numbers)}

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return sum(len(stretch.outputs) for stretch in self._stretches)

    @property
    def recomputable(self) -> bool:
        """Not what passed a low-pass."""
        return self._taps.size == 1

    def _get_torques(self, rows: slice) -> FloatArray:
        """Return measured torques, zero where they are not measured."""
        tau = self.motions.tau[rows]
        return tau if self.measured is None else np.where(self.measured, tau, 0.0)

    def iterate_blocks(self) -> Iterator[Block]:
        """Yield the samples in order; every call starts anew."""
        observed = ObservedSet(
            make_spans([stretch.size for stretch in self._stretches]), self._read_states, self.dynamics,
            np.zeros(self.dynamics.mechanism.n_parameters), self.source,
        )  # fmt: skip
        for number, blocks in groupby(observed.iterate_blocks(), attrgetter("trajectory")):
            yield from self._filter_blocks(self._stretches[number], blocks)

    def iterate_states(self) -> Iterator[StateBlock]:
        """Yield states and low-passed torques of the samples alone."""
        m = self.motions
        k = self._taps.size // 2
        for number, stretch in enumerate(self._stretches):
            for start in range(0, len(stretch.outputs), BLOCK_SAMPLES):
                some = np.array(stretch.outputs[start : start + BLOCK_SAMPLES])
                needed = slice(int(some[0]) - k, int(some[-1]) + k + 1)
                rows = self._get_torques(
                    slice(stretch.first + needed.start, stretch.first + needed.stop)
                )
                tau = filters.filter_samples(rows, needed.start, self._taps, some)
                part = slice(stretch.first + int(some[0]), stretch.first + int(some[-1]) + 1)
                own = some - some[0]
                z, dz, ddz = m.z[part][own], m.dz[part][own], m.ddz[part][own]
                yield StateBlock(number, m.time[part][own], z, dz, ddz, tau)

    def _read_states(self, span: Span) -> StateBlock:
        """Return states and measured torques, also those that only serve the low-pass."""
        m, first = self.motions, self._stretches[span.trajectory].first
        part = slice(first + span.start, first + span.stop)
        states = m.time[part], m.z[part], m.dz[part], m.ddz[part]
        return StateBlock(span.trajectory, *states, self._get_torques(part))

    def _filter_blocks(self, stretch: _Stretch, blocks: Iterator[Block]) -> Iterator[Block]:
        """Yield blocks of the used samples; only the rows that the low-pass still needs stay in memory."""
        waiting = stretch.outputs
        k = self._taps.size // 2
        held: list[Block] = []
        first = 0
        end = 0
        for block in blocks:
            held.append(block)
            end += block.time.size
            count = bisect_left(waiting, end - k)
            ready, waiting = np.array(waiting[:count], dtype=np.int64), waiting[count:]
            fold = stretch.find_folds(ready)
            for number in np.unique(fold).tolist():
                yield self._make_block(held, first, ready[fold == number], self._folds[number])
            needed = waiting[0] - k if waiting else end
            while held and first + held[0].time.size <= needed:
                first += held.pop(0).time.size

    def _make_block(self, held: list[Block], first: int, outputs: IntArray, fold: int) -> Block:
        """Return the block of some output samples from the rows in memory."""

        def join(key: str) -> FloatArray:
            return np.concatenate([getattr(block, key) for block in held])

        tau = join("tau")
        n_rows, n_dof = tau.shape
        states = {key: join(key)[outputs - first] for key in _STATES}
        W = join("W").reshape(n_rows, -1)
        if self._taps.size == 1:
            W, tau = W[outputs - first], tau[outputs - first]
        else:
            W = filters.filter_samples(W, first, self._taps, outputs)
            tau = filters.filter_samples(tau, first, self._taps, outputs)
        return Block(trajectory=fold, tau=tau, W=W.reshape(outputs.size * n_dof, -1), **states)

    def compute_factors(self) -> FloatArray:
        """Return the triangular factors by fold and joint."""
        return compute_joint_factors(self.iterate_blocks())
