"""States of joints from recorded positions: low-pass, differentiation and decimation."""

from dataclasses import dataclass

import numpy as np

from paramreduce_cli.identification import filters
from paramreduce_cli.identification.data_split import STILL, Piece
from paramreduce_cli.identification.signals import Signals
from paramreduce_cli.records import FloatArray
from paramreduce_cli.resources.scratch import allocate_matrix

_PER_TORQUE_CUTOFF = 40
"""Samples per period of the torque cut-off in which the observation matrix is filtered."""
PER_STATE_CUTOFF = 6
"""Samples per period of the state cut-off that motions are kept with."""
_LARGEST_EDGE = 0.125
"""Largest share of a piece that is left out at each of its ends."""


@dataclass(frozen=True)
class Cutoffs:
    """The cut-off frequencies of states and torques, Hz; infinite for no low-pass."""

    state: float
    torque: float


def choose_decimation(cutoffs: Cutoffs, rate: float, without_low_pass: float) -> int:
    """Return the decimation factor of the motions.

    Args:
        cutoffs: Cut-off frequencies.
        rate: Recorded samples per second.
        without_low_pass: Samples per second that are kept if torques pass no low-pass.
    """
    if np.isfinite(cutoffs.torque):
        needed = _PER_TORQUE_CUTOFF * cutoffs.torque
        if np.isfinite(cutoffs.state):
            needed = max(needed, PER_STATE_CUTOFF * cutoffs.state)
    else:
        needed = without_low_pass
    return max(1, int(rate / needed + 1e-9))


def estimate_states(piece: Piece, rate: float, cutoffs: Cutoffs, decimation: int) -> Piece:
    """Return a low-passed, differentiated and decimated piece.

    Samples near the ends, where the low-pass of positions lacks neighbours, are no longer used. Joints are processed
    one by one to save memory.

    Args:
        piece: Piece as recorded.
        rate: Recorded samples per second.
        cutoffs: Cut-off frequencies.
        decimation: Decimation factor.
    """
    s = piece.signals
    state = filters.design_low_pass(cutoffs.state, rate)
    torque = np.ones(1)
    if decimation > 1 and np.isfinite(cutoffs.torque):
        torque = filters.design_low_pass(filters.ANTI_ALIAS * rate / decimation, rate)
    known = s.dz is not None and s.ddz is not None
    if known and decimation == state.size == torque.size == 1:
        return piece
    time = s.time[::decimation]
    z, dz, ddz, tau = (allocate_matrix(time.size, s.z.shape[1]) for _ in range(4))
    for j in range(s.z.shape[1]):
        made = _process_joint(s.get_joint(j), rate, state, torque)
        for whole, values in zip((z, dz, ddz, tau), made, strict=True):
            whole[:, j] = values[::decimation, 0]
    edge = compute_edge(piece, rate, cutoffs.state)
    return cut_ends(Piece(Signals(time, z, dz, ddz, tau), piece.first, piece.last), edge)


def compute_edge(piece: Piece, rate: float, cutoff: float) -> float:
    """Return the time at each end of a piece in which the low-pass of positions lacks neighbours, s.

    Of short pieces an eighth is returned at most.
    """
    time = piece.signals.time
    k = filters.design_low_pass(cutoff, rate).size // 2
    return min(k / rate, _LARGEST_EDGE * float(time[-1] - time[0]))


def cut_ends(piece: Piece, edge: float) -> Piece:
    """Return a piece of which samples nearer than ``edge``, s, to the ends only serve filters.

    An end at which no joint moves is left as it is: the low-pass extends it by what it was.
    """
    time = piece.signals.time
    first, last = time[0] + edge, time[-1] - edge
    if _is_still(piece, slice(int(np.searchsorted(time, first)))):
        first = time[0]
    if _is_still(piece, slice(int(np.searchsorted(time, last)), None)):
        last = time[-1]
    return Piece(piece.signals, float(max(piece.first, first)), float(min(piece.last, last)))


def _is_still(piece: Piece, rows: slice) -> bool:
    """Return whether no joint moves in some rows."""
    z = piece.signals.z
    ranges = np.array([np.ptp(column) for column in z.T])
    moved = np.array([np.ptp(column) if column.size else 0.0 for column in z[rows].T])
    return bool(np.all(moved <= STILL * ranges))


def _process_joint(
    s: Signals, rate: float, state: FloatArray, torque: FloatArray
) -> tuple[FloatArray, ...]:
    """Return z, dz, ddz and tau of one joint after their filters, (n_samples, 1) each."""
    if np.ptp(s.z) == 0:  # round-off of filters would be taken for a motion
        still = np.zeros_like(s.z)
        return s.z, still, still, filters.apply_filter(s.tau, torque)
    z = filters.apply_filter(s.z, state)
    dz = filters.differentiate(z, rate) if s.dz is None else filters.apply_filter(s.dz, state)
    ddz = filters.differentiate(dz, rate) if s.ddz is None else filters.apply_filter(s.ddz, state)
    return z, dz, ddz, filters.apply_filter(s.tau, torque)
