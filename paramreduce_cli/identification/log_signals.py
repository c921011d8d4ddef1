"""Signals of a log that figures show: its longest motion, before and after processing."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.identification import filters
from paramreduce_cli.identification.data_split import Piece
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
    """The position of the shown motion among all motions."""

    file: int
    learned: int
    """Among all motions that are learned from."""
    held_out: int | None
    """Among those held out the one that goes on where it ends; None if there is none."""

    def get_pieces(self, learned: Sequence[Piece], held_out: Sequence[Piece]) -> list[Piece]:
        """Return the shown motions."""
        return [
            learned[self.learned],
            *([] if self.held_out is None else [held_out[self.held_out]]),
        ]


def find_longest(learned: list[list[Piece]], held_out: list[list[Piece]], rate: float) -> Place:
    """Return the longest training motion, together with the held-out part of the same motion.

    Args:
        learned: Training motions, at least one.
        held_out: Held-out motions of the same files; empty if they are from other files.
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


def iterate_speeds(piece: Signals, rate: float) -> Iterator[FloatArray]:
    """Yield the speeds joint by joint: recorded ones, or differences of positions if none were recorded."""
    if piece.dz is not None:
        return iter(piece.dz.T)
    # Plain differences: noise that is white in the positions rises to the end of the spectrum.
    return (np.diff(z, append=z[-1:]) * rate for z in piece.z.T)


def decimate_recorded(pieces: Sequence[Piece], rate: float) -> list[FloatArray]:
    """Return times, positions, speeds and torques of motions that follow each other, decimated."""
    return _concatenate([_decimate(p.signals, iterate_speeds(p.signals, rate), iter(p.signals.tau.T)) for p in pieces])  # fmt: skip


def collect_signals(
    recorded: Sequence[FloatArray],
    ready: Sequence[Piece],
    torque_cutoff: float,
    rate: float,
    outliers: Outliers,
) -> ShownSignals:
    """Return the signals that figures show.

    Args:
        recorded: Times, positions, speeds and torques as recorded.
        ready: Processed training motion, with the held-out part of the same motion if there is one.
        torque_cutoff: Cut-off frequency of the low-pass that torques still have to pass, Hz.
        rate: Samples per second of the processed signals.
        outliers: Outliers of the file.
    """
    taps = filters.design_low_pass(torque_cutoff, rate)
    raw_time, raw_z, raw_dz, raw_tau = recorded
    time, z, dz, ddz, tau = _concatenate(
        [_decimate_processed(piece.signals, taps) for piece in ready]
    )
    bounds = [*map(_find_bounds, ready), np.full(2, np.nan)]
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


def _decimate_processed(s: Signals, taps: FloatArray) -> list[FloatArray]:
    """Return times, positions, speeds, accelerations and low-passed torques of a motion, decimated.

    States have been low-passed before.

    Args:
        s: Motion that has been processed, with speeds and accelerations.
        taps: Coefficients of the low-pass filter.
    """
    assert s.dz is not None, "made ready"
    assert s.ddz is not None, "made ready"
    torques = (filters.apply_filter(s.tau[:, j : j + 1], taps)[:, 0] for j in range(s.tau.shape[1]))
    return _decimate(s, iter(s.dz.T), iter(s.ddz.T), torques)


def _find_bounds(piece: Piece) -> FloatArray:
    """Return the times between which samples are used; NaN if none are."""
    used = piece.signals.time[piece.used]
    return np.array([used[0], used[-1]]) if used.size else np.full(2, np.nan)


def _decimate(piece: Signals, *others: Iterator[FloatArray]) -> list[FloatArray]:
    """Return copies of decimated times, positions and other signals, so that the full signals can be freed."""
    every = slice(None, None, max(1, piece.time.size // _MOST_SHOWN))
    columns = (iter(piece.z.T), *others)
    made = (np.column_stack([column[every] for column in joints]) for joints in columns)
    return [piece.time[every].copy(), *made]


def _concatenate(parts: Sequence[Sequence[FloatArray]]) -> list[FloatArray]:
    return [np.concatenate(signal) for signal in zip(*parts, strict=True)]
