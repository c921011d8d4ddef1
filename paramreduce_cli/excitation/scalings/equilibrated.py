"""Columns and rows of unit size."""

from collections.abc import Callable

import numpy as np

from paramreduce_cli.excitation.scalings import Pullback
from paramreduce_cli.records import FloatArray


def equilibrated(W: FloatArray, beta: FloatArray, norm: float) -> tuple[FloatArray, Pullback]:
    """Return the matrix with its columns divided by their largest magnitude, then its rows by theirs."""
    columns, pull_columns = _divide_by_largest(W, 0, norm)
    rows, pull_rows = _divide_by_largest(columns, 1, norm)
    return rows, lambda _, C: pull_columns(pull_rows(rows @ C))


def _divide_by_largest(
    W: FloatArray, axis: int, norm: float
) -> tuple[FloatArray, Callable[[FloatArray], FloatArray]]:
    """Return W divided by its largest magnitudes along an axis, and the function that maps derivatives back."""
    size, fraction = _compute_largest(W, axis, norm)
    scaled = W / size

    def pull_back(bar: FloatArray) -> FloatArray:
        """Return the derivative with respect to W, given that with respect to the scaled matrix."""
        lost = np.sum(bar * scaled, axis=axis, keepdims=True)
        result: FloatArray = (bar - lost * fraction) / size
        return result

    return scaled, pull_back


def _compute_largest(W: FloatArray, axis: int, norm: float) -> tuple[FloatArray, FloatArray]:
    """Return a smooth maximum of the magnitudes along an axis, and its derivative with respect to W.

    The maximum is a p-norm whose exponent is a power of two, which is quick to compute.
    """
    magnitude = np.abs(W)
    largest = magnitude.max(axis=axis, keepdims=True)
    largest = np.where(largest > 0, largest, 1.0)
    if np.isinf(norm):
        where = np.expand_dims(np.argmax(magnitude, axis=axis), axis)
        fraction = np.zeros_like(W)
        np.put_along_axis(fraction, where, np.sign(np.take_along_axis(W, where, axis)), axis)
        return largest, fraction
    ratio = W / largest
    power, odd = ratio * ratio, ratio.copy()
    doublings = max(1, round(np.log2(norm)))
    for _ in range(doublings - 1):
        odd *= power
        power *= power
    total = np.maximum(power.sum(axis=axis, keepdims=True), np.finfo(float).tiny)
    root = total ** (1 / 2**doublings)
    return largest * root, odd * (root / total)
