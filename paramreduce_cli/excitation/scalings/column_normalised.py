"""Columns of unit length."""

import numpy as np

from paramreduce_cli.excitation.scalings import Pullback
from paramreduce_cli.records import FloatArray


def column_normalised(W: FloatArray, beta: FloatArray, norm: float) -> tuple[FloatArray, Pullback]:
    """Return the columns divided by their 2-norms."""
    norms = np.maximum(np.sqrt(np.einsum("ij,ij->j", W, W)), np.finfo(float).tiny)
    scaled = W / norms

    def pull_back(gram: FloatArray, C: FloatArray) -> FloatArray:
        """Return the derivative with respect to W, given that with respect to the Gram matrix."""
        along = np.einsum("ij,ij->j", gram, C)  # the diagonal of S' (S C)
        result: FloatArray = scaled @ ((C - np.diag(along)) / norms)
        return result

    return scaled, pull_back
