"""In which scaling of the observation matrix a criterion is measured.

A scaling takes the rows-weighted W of the base columns to the matrix that is measured, and
hands back how a derivative with respect to that matrix is pulled back to W.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from paramreduce_cli.records import FloatArray
from paramreduce_cli.registry import scaling

Pullback = Callable[[FloatArray], FloatArray]
Scaling = Callable[[FloatArray, FloatArray], tuple[FloatArray, Pullback]]
"""(W, beta) -> (scaled W, pullback); W is (n_rows, r), beta (r, n - r)."""


@scaling("column-normalised")
def column_normalised(W: FloatArray, beta: FloatArray) -> tuple[FloatArray, Pullback]:
    """Columns divided by their 2-norms."""
    norms = np.maximum(np.linalg.norm(W, axis=0), np.finfo(float).tiny)
    scaled = W / norms

    def pull(bar: FloatArray) -> FloatArray:
        return (bar - scaled * np.einsum("ij,ij->j", bar, scaled)) / norms

    return scaled, pull


@scaling("weighted")
def weighted(W: FloatArray, beta: FloatArray) -> tuple[FloatArray, Pullback]:
    """Rows weighted by the nominal torques, columns as they are."""
    return W, lambda bar: bar


@scaling("equilibrated")
def equilibrated(W: FloatArray, beta: FloatArray) -> tuple[FloatArray, Pullback]:
    """Columns divided by their largest magnitude, then rows by theirs."""
    columns, pull_columns = _divide_by_largest(W, axis=0)
    rows, pull_rows = _divide_by_largest(columns, axis=1)
    return rows, lambda bar: pull_columns(pull_rows(bar))


def _divide_by_largest(W: FloatArray, axis: int) -> tuple[FloatArray, Pullback]:
    where = np.expand_dims(np.argmax(np.abs(W), axis=axis), axis)
    signed = np.take_along_axis(W, where, axis)
    size = np.where(signed == 0.0, 1.0, np.abs(signed))
    scaled = W / size

    def pull(bar: FloatArray) -> FloatArray:
        result = bar / size
        lost = np.sum(bar * scaled, axis=axis, keepdims=True) / size * np.sign(signed)
        at = np.take_along_axis(result, where, axis)
        np.put_along_axis(result, where, at - lost, axis)
        return result

    return scaled, pull


@scaling("full")
def full(W: FloatArray, beta: FloatArray) -> tuple[FloatArray, Pullback]:
    """All columns of W, dependent ones too: its non-zero singular values [Ros2019].

    W_all = W [1 beta] up to order, so its singular values are those of W L with
    L L' = 1 + beta beta'.
    """
    L = np.linalg.cholesky(np.eye(beta.shape[0]) + beta @ beta.T)
    return W @ L, lambda bar: bar @ L.T
