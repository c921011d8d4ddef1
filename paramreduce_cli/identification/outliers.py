"""Outliers: single samples far from their neighbours."""

import numpy as np
import scipy  # whose ndimage is loaded when it is used

from paramreduce_cli.identification.signals import Signals
from paramreduce_cli.records import BoolArray, FloatArray, IntArray

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
    """Replace single samples far from the median of their neighbours by interpolation [Hampel1974], in place.

    Returns:
        Times of the samples that were replaced, s, by signal and joint; only of those that had any.
    """
    found: dict[tuple[str, int], list[float]] = {}
    for piece in pieces:
        for signal, values in (("position", piece.z), ("torque", piece.tau)):
            for j, column in enumerate(values.T):
                away = np.abs(column - scipy.ndimage.median_filter(column, _WINDOW, mode="nearest"))
                # In smooth signals every peak is far from its neighbours, but never by much.
                limits = _FAR * np.maximum(
                    _TO_SIGMA * _smooth_largest(away), _SMALL * float(np.std(column))
                )
                far = np.flatnonzero(away > np.repeat(limits, _STRETCH)[: away.size])
                far = far[_find_spikes(column, far, 0.5 * limits[far // _STRETCH])]
                if far.size:
                    found.setdefault((signal, j), []).extend(piece.time[far].tolist())
                    good = np.delete(np.arange(column.size), far)
                    column[far] = np.interp(far, good, column[good])
    return found


def _smooth_largest(away: FloatArray) -> FloatArray:
    """Return the largest median of each stretch and its neighbours, because noise varies along a motion."""
    whole = away[: away.size // _STRETCH * _STRETCH].reshape(-1, _STRETCH)
    # Some at a time, as medians are of copies.
    parts = [np.median(whole[k : k + _AT_ONCE], axis=1) for k in range(0, len(whole), _AT_ONCE)]
    rest = away[whole.size :]
    medians = np.concatenate([*parts, [np.median(rest)] if rest.size else []])
    largest: FloatArray = scipy.ndimage.maximum_filter1d(medians, 3, mode="nearest")
    return largest


def _find_spikes(column: FloatArray, rows: IntArray, least: FloatArray) -> BoolArray:
    """Return which samples lie above or below both neighbours by more than ``least``; samples of a step do not."""
    before = column[rows] - column[np.maximum(rows - 1, 0)]
    after = column[rows] - column[np.minimum(rows + 1, column.size - 1)]
    found: BoolArray = (before * after > 0) & (np.minimum(np.abs(before), np.abs(after)) > least)
    return found
