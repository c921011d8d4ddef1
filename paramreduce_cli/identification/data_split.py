"""Pieces of motions, and which of their samples are used for training or held out."""

from dataclasses import dataclass

import numpy as np

from paramreduce_cli.config.log_settings import LogSection
from paramreduce_cli.identification.signals import Signals

UNUSED = -1
"""Fold of samples that only serve filters."""
STILL = 2e-3
"""Share of a joint's range within which it stands still."""
_ROUNDING = 1e-9
_SHORTEST = 20
"""Samples of a piece that a border makes."""


@dataclass(frozen=True)
class Piece:
    """A piece of a motion, and the interval of time whose samples are used; the rest only serves filters."""

    signals: Signals
    first: float
    last: float

    def slice_rows(self, rows: slice) -> "Piece":
        """Return some samples of the piece."""
        return Piece(self.signals.slice_rows(rows), self.first, self.last)

    @property
    def used(self) -> slice:
        """Samples that are used."""
        time = self.signals.time
        start, stop = np.searchsorted(time, [self.first - _ROUNDING, self.last + _ROUNDING])
        return slice(int(start), int(max(start, stop)))


def trim_files(pieces: list[Signals], section: LogSection) -> list[Piece]:
    """Return pieces whose samples near the start and the end of a file are not used; they still serve filters."""
    first, last = pieces[0].time[0] + section.trim[0], pieces[-1].time[-1] - section.trim[1]
    if section.standstill == "cut":
        time = np.concatenate([piece.time for piece in pieces])
        starts, ends = [], []
        for j in range(pieces[0].z.shape[1]):
            z = np.concatenate([piece.z[:, j] for piece in pieces])
            still = STILL * max(np.ptp(z), 1e-12)
            starts += np.flatnonzero(np.abs(z - z[0]) > still)[:1].tolist()
            ends += np.flatnonzero(np.abs(z - z[-1]) > still)[-1:].tolist()
        if starts:
            first, last = max(first, time[min(starts)]), min(last, time[max(ends)])
    return [Piece(piece, first, last) for piece in pieces]


def split_pieces(pieces: list[Piece], fraction: float) -> tuple[list[Piece], list[Piece]]:
    """Split pieces in time: return pieces with the first fraction of the used samples, and pieces with the rest.

    Pieces that would be too short are left out.
    """
    left = int(fraction * sum(p.used.stop - p.used.start for p in pieces))
    first, second = [], []
    for piece in pieces:
        size = piece.used.stop - piece.used.start
        if left >= size:
            first.append(piece)
        elif left <= 0:
            second.append(piece)
        else:
            border = piece.used.start + left
            first.append(piece.slice_rows(slice(border)))
            second.append(piece.slice_rows(slice(border, None)))
        left -= size
    return (
        [p for p in first if p.signals.time.size >= _SHORTEST],
        [p for p in second if p.signals.time.size >= _SHORTEST],
    )
