"""What figures show of a log: its longest motion, before and after."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.identification import filters
from paramreduce_cli.identification.pieces import Piece
from paramreduce_cli.identification.signals import Signals
from paramreduce_cli.records import FloatArray, ShownSignals

_MOST_SHOWN = 1500
"""Samples of a part."""
_OUTLYING = ("position", "torque")
"""Signals with outliers, in the order in which they are numbered."""

Outliers = Mapping[tuple[str, int], Sequence[float]]
"""Times of samples that were replaced, s, by signal and joint."""


@dataclass(frozen=True)
class Place:
    """Where the motion that is shown is among all motions."""

    file: int
    learned: int
    """Among all motions that are learned from."""
    held_out: int | None
    """Among those held out the one that goes on where it ends; None if there is none."""

    def of(self, learned: Sequence[Piece], held_out: Sequence[Piece]) -> list[Piece]:
        """The motions that are shown, of all."""
        return [
            learned[self.learned],
            *([] if self.held_out is None else [held_out[self.held_out]]),
        ]


def place_to_show(learned: list[list[Piece]], held_out: list[list[Piece]], rate: float) -> Place:
    """The longest motion that is learned from, both by file.

    Args:
        learned: At least one motion.
        held_out: Of the same files; empty if it is of others.
        rate: Samples per second.
    """
    sizes = [
        (piece.signals.time.size, file, k)
        for file, pieces in enumerate(learned)
        for k, piece in enumerate(pieces)
    ]
    _, file, k = max(sizes)
    place = sum(map(len, learned[:file])) + k
    later = held_out[file] if held_out else []
    if k + 1 < len(learned[file]) or not later:
        return Place(file, place, None)
    gap = later[0].signals.time[0] - learned[file][k].signals.time[-1]
    return Place(file, place, sum(map(len, held_out[:file])) if gap < 1.5 / rate else None)


def speeds(piece: Signals, rate: float) -> Iterator[FloatArray]:
    """As recorded, or differences of positions, joint by joint."""
    if piece.dz is not None:
        return iter(piece.dz.T)
    # Plain differences: noise that is white in the positions rises to the end of the spectrum.
    return (np.diff(z, append=z[-1:]) * rate for z in piece.z.T)


def recorded_to_show(pieces: Sequence[Piece], rate: float) -> list[FloatArray]:
    """Times, positions, speeds and torques of motions that follow each other, thinned."""
    return _joined([_thinned(p.signals, speeds(p.signals, rate), iter(p.signals.tau.T)) for p in pieces])  # fmt: skip


def shown(
    recorded: Sequence[FloatArray],
    ready: Sequence[Piece],
    torque_cutoff: float,
    rate: float,
    outliers: Outliers,
) -> ShownSignals:
    """Put together what is shown.

    Args:
        recorded: Times, positions, speeds and torques as recorded.
        ready: What is learned from, and what is held out of the same motion if anything is.
        torque_cutoff: Of the low-pass that torques have still to pass, Hz.
        rate: Samples per second of what is ready.
        outliers: Of the file.
    """
    taps = filters.low_pass(torque_cutoff, rate)
    raw_time, raw_z, raw_dz, raw_tau = recorded
    time, z, dz, ddz, tau = _joined([_states_and_torques(piece.signals, taps) for piece in ready])
    bounds = [*map(_bounds, ready), np.full(2, np.nan)]
    replaced = [
        (_OUTLYING.index(signal), j, time_of)
        for (signal, j), times in outliers.items()
        for time_of in times
        if raw_time[0] <= time_of <= raw_time[-1]
    ]
    return ShownSignals(
        raw_time=raw_time, raw_z=raw_z, raw_dz=raw_dz, raw_tau=raw_tau, time=time, z=z, dz=dz, ddz=ddz, tau=tau,
        learned=bounds[0], held_out=bounds[1], outliers=np.array(replaced, dtype=float).reshape(-1, 3),
    )  # fmt: skip


def _states_and_torques(s: Signals, taps: FloatArray) -> list[FloatArray]:
    assert s.dz is not None, "made ready"
    assert s.ddz is not None, "made ready"
    torques = (filters.filtered(s.tau[:, j : j + 1], taps)[:, 0] for j in range(s.tau.shape[1]))
    return _thinned(s, iter(s.dz.T), iter(s.ddz.T), torques)


def _bounds(piece: Piece) -> FloatArray:
    """Between which times samples are used; not numbers where none are."""
    used = piece.signals.time[piece.used]
    return np.array([used[0], used[-1]]) if used.size else np.full(2, np.nan)


def _thinned(piece: Signals, *others: Iterator[FloatArray]) -> list[FloatArray]:
    """Times, positions and others, copied so that the rest may be forgotten."""
    every = slice(None, None, max(1, piece.time.size // _MOST_SHOWN))
    columns = (iter(piece.z.T), *others)
    made = (np.column_stack([column[every] for column in joints]) for joints in columns)
    return [piece.time[every].copy(), *made]


def _joined(parts: Sequence[Sequence[FloatArray]]) -> list[FloatArray]:
    return [np.concatenate(signal) for signal in zip(*parts, strict=True)]
