"""The determinant of W'W."""

import numpy as np

from paramreduce_cli.excitation.criteria import SMALLEST
from paramreduce_cli.records import FloatArray


def d_optimality(eigenvalues: FloatArray, sharpness: float) -> tuple[float, FloatArray]:
    """Return minus half the logarithm of det W'W per parameter, and its derivative with respect to the eigenvalues.

    The sharpness does not matter, because the function is smooth.
    """
    safe = np.maximum(eigenvalues, SMALLEST)
    r = eigenvalues.size
    return -0.5 * float(np.sum(np.log(safe))) / r, -0.5 / (safe * r)
