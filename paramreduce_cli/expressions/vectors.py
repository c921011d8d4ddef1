"""Small vectors and matrices of scalars, as tuples.

The scalars may be CasADi's or those of an expression graph: products with the zeros and ones of
a geometry vanish as they are formed, instead of being simplified afterwards.
"""

from collections.abc import Sequence
from typing import Any

Vector = tuple[Any, Any, Any]
Matrix = tuple[Vector, Vector, Vector]
"""Rows of a 3 x 3 matrix."""


def add(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def subtract(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scale(factor: Any, a: Vector) -> Vector:
    """Return the vector a times a factor."""
    return (factor * a[0], factor * a[1], factor * a[2])


def dot(a: Sequence, b: Vector) -> Any:
    """Return the inner product a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Sequence, b: Sequence) -> Vector:
    """Return the cross product a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def apply(matrix: Sequence[Sequence], a: Vector) -> Vector:
    """Return the product of a matrix, given by rows, with a; entries that are the numbers 0 and 1 cost nothing."""
    return (_sum_weighted(matrix[0], a), _sum_weighted(matrix[1], a), _sum_weighted(matrix[2], a))


def _sum_weighted(weights: Sequence, a: Vector) -> Any:
    # An operation of CasADi takes long even where nothing comes of it, and turns are mostly zeros.
    """Return the weighted sum of a vector's entries without products with 0 and 1."""
    terms = [
        entry if isinstance(weight, float) and weight == 1 else weight * entry
        for weight, entry in zip(weights, a, strict=True)
        if not (isinstance(weight, float) and weight == 0)
    ]
    return sum(terms[1:], terms[0]) if terms else 0 * a[0]
