"""Single samples far from their neighbours."""

import numpy as np
from scipy import ndimage

from paramreduce_cli.identification.signals import Signals
from paramreduce_cli.records import FloatArray

_WINDOW = 7
"""Neighbours that tell an outlier."""
_STRETCH = 200
"""Samples whose noise is taken to be alike."""
_AT_ONCE = 500
"""Such stretches."""
_FAR = 12.0
"""Robust standard deviations from the median of its neighbours at which a sample is an outlier."""
_SMALL = 0.02
"""Share of a signal's own deviation that its noise is taken for at least."""
_TO_SIGMA = 1.4826
"""Median absolute deviation to standard deviation of normal noise."""


def replace_outliers(pieces: list[Signals]) -> dict[tuple[str, int], list[float]]:
    """Interpolate single samples far from the median of their neighbours [Hampel1974], in place.

    Returns:
        Times of the samples that were replaced, s, by signal and joint; only of those that had any.
    """
    found: dict[tuple[str, int], list[float]] = {}
    for piece in pieces:
        for signal, values in (("position", piece.z), ("torque", piece.tau)):
            for j, column in enumerate(values.T):
                away = np.abs(column - ndimage.median_filter(column, _WINDOW, mode="nearest"))
                # In smooth signals every peak is far from its neighbours, but never by much.
                sigma = np.maximum(_TO_SIGMA * _around(away), _SMALL * float(np.std(column)))
                far = (away > _FAR * sigma) & _alone(column, 0.5 * _FAR * sigma)
                if far.any():
                    found.setdefault((signal, j), []).extend(piece.time[far].tolist())
                    good = np.flatnonzero(~far)
                    column[far] = np.interp(np.flatnonzero(far), good, column[good])
    return found


def _around(away: FloatArray) -> FloatArray:
    """Medians of the stretch of each sample and its neighbours, the largest: noise varies along a motion."""
    whole = away[: away.size // _STRETCH * _STRETCH].reshape(-1, _STRETCH)
    # Some at a time, as medians are of copies.
    parts = [np.median(whole[k : k + _AT_ONCE], axis=1) for k in range(0, len(whole), _AT_ONCE)]
    rest = away[whole.size :]
    medians = np.concatenate([*parts, [np.median(rest)] if rest.size else []])
    largest: FloatArray = ndimage.maximum_filter1d(medians, 3, mode="nearest")
    return np.repeat(largest, _STRETCH)[: away.size]


def _alone(column: FloatArray, least: FloatArray) -> np.ndarray:
    """Samples that stick out from both neighbours to one side; a step's samples do not."""
    before = np.diff(column, prepend=column[:1])
    after = -np.diff(column, append=column[-1:])
    found: np.ndarray = (before * after > 0) & (np.minimum(np.abs(before), np.abs(after)) > least)
    return found
