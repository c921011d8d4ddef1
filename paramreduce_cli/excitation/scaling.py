"""In which scaling of the observation matrix a criterion is measured.

A scaling takes the rows-weighted W of the base columns to the matrix that is measured, and
hands back how a derivative with respect to that matrix is pulled back to W. It is given the
exponent of the smooth maxima that stand for true ones while optimising, infinite for those.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from paramreduce_cli.records import FloatArray
from paramreduce_cli.registry import scaling

Pullback = Callable[[FloatArray], FloatArray]
Scaling = Callable[[FloatArray, FloatArray, float], tuple[FloatArray, Pullback]]
"""(W, beta, norm) -> (scaled W, pullback); W is (n_rows, r), beta (r, n - r)."""


@scaling("column-normalised")
def column_normalised(W: FloatArray, beta: FloatArray, norm: float) -> tuple[FloatArray, Pullback]:
    """Columns divided by their 2-norms."""
    norms = np.maximum(np.linalg.norm(W, axis=0), np.finfo(float).tiny)
    scaled = W / norms

    def pull(bar: FloatArray) -> FloatArray:
        return (bar - scaled * np.einsum("ij,ij->j", bar, scaled)) / norms

    return scaled, pull


@scaling("weighted")
def weighted(W: FloatArray, beta: FloatArray, norm: float) -> tuple[FloatArray, Pullback]:
    """Rows weighted by the nominal torques, columns as they are."""
    return W, lambda bar: bar


@scaling("equilibrated")
def equilibrated(W: FloatArray, beta: FloatArray, norm: float) -> tuple[FloatArray, Pullback]:
    """Columns divided by their largest magnitude, then rows by theirs."""
    columns, pull_columns = _divide_by_largest(W, 0, norm)
    rows, pull_rows = _divide_by_largest(columns, 1, norm)
    return rows, lambda bar: pull_columns(pull_rows(bar))


def _divide_by_largest(W: FloatArray, axis: int, norm: float) -> tuple[FloatArray, Pullback]:
    size, share = _largest(W, axis, norm)
    scaled = W / size

    def pull(bar: FloatArray) -> FloatArray:
        lost = np.sum(bar * scaled, axis=axis, keepdims=True)
        result: FloatArray = (bar - lost * share) / size
        return result

    return scaled, pull


def _largest(W: FloatArray, axis: int, norm: float) -> tuple[FloatArray, FloatArray]:
    """Largest magnitude along an axis and its derivative by W.

    Smoothly as the norm of the next power of two, whose powers are cheap.
    """
    magnitude = np.abs(W)
    largest = magnitude.max(axis=axis, keepdims=True)
    largest = np.where(largest > 0, largest, 1.0)
    if np.isinf(norm):
        where = np.expand_dims(np.argmax(magnitude, axis=axis), axis)
        share = np.zeros_like(W)
        np.put_along_axis(share, where, np.sign(np.take_along_axis(W, where, axis)), axis)
        return largest, share
    ratio = W / largest
    power, odd = ratio * ratio, ratio.copy()
    doublings = max(1, round(np.log2(norm)))
    for _ in range(doublings - 1):
        odd *= power
        power *= power
    total = np.maximum(power.sum(axis=axis, keepdims=True), np.finfo(float).tiny)
    root = total ** (1 / 2**doublings)
    return largest * root, odd * (root / total)


@scaling("full")
def full(W: FloatArray, beta: FloatArray, norm: float) -> tuple[FloatArray, Pullback]:
    """All columns of W, dependent ones too: its non-zero singular values [Ros2019].

    W_all = W [1 beta] up to order, so its singular values are those of W L with
    L L' = 1 + beta beta'.
    """
    L = np.linalg.cholesky(np.eye(beta.shape[0]) + beta @ beta.T)
    return W @ L, lambda bar: bar @ L.T
