"""What makes a trajectory exciting, as functions of the eigenvalues of W'W.

A criterion returns a smooth value to minimise with its derivative by the eigenvalues; the
sharper, the closer to the exact criterion.
"""

from collections.abc import Callable

from paramreduce_cli.records import FloatArray
from paramreduce_cli.registry import Registry

Criterion = Callable[[FloatArray, float], tuple[float, FloatArray]]
"""(eigenvalues of W'W, sharpness) -> (value, its derivative by the eigenvalues)."""

criteria = Registry("criterion", __name__)

SMALLEST = 1e-300
"""Stands for an eigenvalue of zero, whose logarithm there is none of."""
