"""Small symmetric matrices, mostly one for each sample, for computations that a search repeats thousands of times."""

from __future__ import annotations

import numpy as np

from paramreduce_cli.expressions.loops import compile_loop
from paramreduce_cli.records import FloatArray

_SINGULAR = 1e-14
"""Pivot over the diagonal element it comes from, below which a matrix has no inverse but for rounding."""


def invert(matrices: FloatArray) -> FloatArray | None:
    """Return the inverses of positive definite matrices, or None if one is not positive definite.

    Args:
        matrices: Symmetric matrices, (n_samples, n, n).
    """
    found, positive = _invert(matrices)
    return found if positive else None


def is_positive_definite(matrices: FloatArray) -> bool:
    """Return whether all matrices are positive definite, (n_samples, n, n)."""
    return bool(_is_positive_definite(matrices))


def compute_roots(factors: FloatArray, weights: FloatArray) -> FloatArray:
    """Return upper triangles R with R' R = F' F + diag(w^2), samples last, (n, n, n_samples).

    Args:
        factors: F, (n_samples, n, n).
        weights: w, (n,).
    """
    try:
        forms = np.swapaxes(factors, 1, 2) @ factors + np.diag(weights**2)
        return np.ascontiguousarray(np.linalg.cholesky(forms).transpose(2, 1, 0))
    except np.linalg.LinAlgError:  # squares of large factors leave nothing of the weights
        below = np.broadcast_to(np.diag(weights), factors.shape)
        R = np.asarray(np.linalg.qr(np.concatenate([factors, below], axis=1), mode="r"))
        return np.ascontiguousarray(R.transpose(1, 2, 0))


@compile_loop()
def multiply_triangles(triangles: FloatArray, vectors: FloatArray) -> FloatArray:
    """Return upper triangular matrices times vectors, sample by sample.

    Args:
        triangles: Matrices, (n, n, n_samples).
        vectors: Vectors, (k, n, n_samples).

    Returns:
        (k, n, n_samples)
    """
    result = np.zeros(vectors.shape)
    k, n, m = vectors.shape
    for c in range(k):
        for i in range(n):
            for j in range(i, n):
                for s in range(m):
                    result[c, i, s] += triangles[i, j, s] * vectors[c, j, s]
    return result


@compile_loop()
def compute_whitening(gram: FloatArray, ridge: float) -> FloatArray:
    """Return the lower triangular matrix that makes columns orthonormal, from their Gram matrix, (n, n).

    Args:
        gram: Gram matrix, (n, n).
        ridge: Fraction of each column's square that is added to it. What earlier columns leave of a column is damped if
            its square is below this fraction.
    """
    n = gram.shape[0]
    size = np.empty(n)
    for i in range(n):
        size[i] = np.sqrt(gram[i, i]) if gram[i, i] > 0 else 1.0
    lower, inverse = np.zeros((n, n)), np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            total = gram[i, j] / (size[i] * size[j])
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            lower[i, j] = total / lower[j, j] if j < i else np.sqrt(max(total, 0.0) + ridge)
    for i in range(n):
        for j in range(i + 1):
            total = 1.0 if i == j else 0.0
            for k in range(j, i):
                total -= lower[i, k] * inverse[k, j]
            inverse[i, j] = total / lower[i, i]
    for i in range(n):
        for j in range(i + 1):
            inverse[i, j] /= size[j]
    return inverse


@compile_loop(within=True)
def _factorise(matrix: FloatArray, lower: FloatArray) -> bool:
    """Write the lower Cholesky factor, and return whether the matrix is positive definite."""
    n = matrix.shape[0]
    for i in range(n):
        least = _SINGULAR * matrix[i, i]
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            if j < i:
                lower[i, j] = total / lower[j, j]
            elif total > least and total > 0:
                lower[i, i] = np.sqrt(total)
            else:
                return False
    return True


@compile_loop()
def _is_positive_definite(matrices: FloatArray) -> bool:
    """Return whether all matrices have a Cholesky factor."""
    lower = np.empty(matrices.shape[1:])
    s = 0
    while s < matrices.shape[0] and _factorise(matrices[s], lower):
        s += 1
    return s == matrices.shape[0]


@compile_loop()
def _invert(matrices: FloatArray) -> tuple[FloatArray, bool]:
    """Return the inverses, and whether all matrices are positive definite."""
    m, n, _ = matrices.shape
    result = np.zeros((m, n, n))
    lower = np.empty((n, n))
    for s in range(m):
        if not _factorise(matrices[s], lower):
            return result, False
        for i in range(n):  # the inverse of the triangle, in place
            lower[i, i] = 1 / lower[i, i]
            for j in range(i):
                total = 0.0
                for k in range(j, i):
                    total += lower[i, k] * lower[k, j]
                lower[i, j] = -total * lower[i, i]
        for i in range(n):
            for j in range(i + 1):
                total = 0.0
                for k in range(i, n):
                    total += lower[k, i] * lower[k, j]
                result[s, i, j] = result[s, j, i] = total
    return result, True
