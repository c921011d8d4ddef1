"""Homogeneous transforms, with the sines and cosines of common angles without rounding.

What counts as a quarter turn, or as an entry of 0 or 1, is decided here for all of the package.
"""

import numpy as np

from paramreduce_cli.records import FloatArray

_EXACT = (0.0, 0.5, 1.0)
_WRITTEN = 1e-10
"""Angles written with ten digits or more are meant to be what they are near to."""
_ROUNDING = 1e-13
"""What products of a few rotations, or sums of a few angles, leave of an exact number."""


def rotate_x(angle: float) -> FloatArray:
    """Return the homogeneous rotation about x, (4, 4)."""
    c, s = _compute_cosine_and_sine(angle)
    return np.array([[1.0, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1]])


def rotate_y(angle: float) -> FloatArray:
    """Return the homogeneous rotation about y, (4, 4)."""
    c, s = _compute_cosine_and_sine(angle)
    return np.array([[c, 0, s, 0], [0, 1.0, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1]])


def rotate_z(angle: float) -> FloatArray:
    """Return the homogeneous rotation about z, (4, 4)."""
    c, s = _compute_cosine_and_sine(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])


def translate(x: float, y: float, z: float) -> FloatArray:
    """Return the homogeneous translation, (4, 4), m."""
    result = np.eye(4)
    result[:3, 3] = x, y, z
    return result


def _compute_cosine_and_sine(angle: float) -> tuple[float, float]:
    """Return cosine and sine of an angle, exact for multiples of a twelfth of a turn.

    With the rounding of pi, cos(pi/2) would be 6e-17 instead of zero, and ranks would change.
    """
    cosine, sine = float(np.cos(angle)), float(np.sin(angle))
    twelfth = np.pi / 6
    if abs(angle - round(angle / twelfth) * twelfth) > _WRITTEN:
        return cosine, sine
    return _remove_rounding(cosine), _remove_rounding(sine)


def _remove_rounding(value: float) -> float:
    """Return 0, ±1/2 or ±1 if the value is one of them to rounding (1e-10), else the value."""
    for exact in _EXACT:
        if abs(abs(value) - exact) <= _WRITTEN:
            return float(np.copysign(exact, value)) if exact else 0.0
    return value


def round_to_right_angles(angle: float) -> float:
    """Return an angle, rad, with whole quarter turns made exact."""
    quarters = round(angle / (np.pi / 2))
    return quarters * np.pi / 2 if abs(angle - quarters * np.pi / 2) <= _WRITTEN else angle


def count_right_angles(angle: float) -> int | None:
    """Return the number of quarter turns in an angle, or None if it is not a whole number."""
    quarters = round(angle / (np.pi / 2))
    return quarters if abs(angle - quarters * np.pi / 2) <= _ROUNDING else None


def clean_rotation(rotation: FloatArray) -> FloatArray:
    """Return a rotation matrix, (3, 3), with entries 0 and 1 made exact."""
    nearest = np.round(rotation)
    return np.where(np.abs(rotation - nearest) < _ROUNDING, nearest, rotation)


def to_axis_angle(rotation: FloatArray) -> tuple[float, FloatArray]:
    """Return the angle, 0 to pi rad, and the axis, (3,), of a rotation matrix; the axis is z if nothing rotates."""
    skew = (rotation - rotation.T) / 2
    across = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    sine, cosine = float(np.linalg.norm(across)), float(np.trace(rotation) - 1) / 2
    angle = float(np.arctan2(sine, cosine))
    if sine > np.sqrt(_ROUNDING):
        return angle, across / sine
    if cosine > 0:
        return angle, np.array([0.0, 0.0, 1.0])
    column = (rotation + np.eye(3))[:, np.argmax(np.diag(rotation))]
    return angle, column / np.linalg.norm(column)
