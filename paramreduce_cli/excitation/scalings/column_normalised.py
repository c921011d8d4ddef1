"""Columns of unit length."""

import numpy as np

from paramreduce_cli.excitation.scalings import Pullback
from paramreduce_cli.records import FloatArray


def column_normalised(W: FloatArray, beta: FloatArray, norm: float) -> tuple[FloatArray, Pullback]:
    """Columns divided by their 2-norms."""
    norms = np.maximum(np.linalg.norm(W, axis=0), np.finfo(float).tiny)
    scaled = W / norms

    def pull(bar: FloatArray) -> FloatArray:
        return (bar - scaled * np.einsum("ij,ij->j", bar, scaled)) / norms

    return scaled, pull
