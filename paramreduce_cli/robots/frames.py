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


def rotation_x(angle: float) -> FloatArray:
    """Homogeneous rotation about x, (4, 4)."""
    c, s = _cosine_and_sine(angle)
    return np.array([[1.0, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1]])


def rotation_y(angle: float) -> FloatArray:
    """Homogeneous rotation about y, (4, 4)."""
    c, s = _cosine_and_sine(angle)
    return np.array([[c, 0, s, 0], [0, 1.0, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1]])


def rotation_z(angle: float) -> FloatArray:
    """Homogeneous rotation about z, (4, 4)."""
    c, s = _cosine_and_sine(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])


def translation(x: float, y: float, z: float) -> FloatArray:
    """Homogeneous translation in m, (4, 4)."""
    result = np.eye(4)
    result[:3, 3] = x, y, z
    return result


def _cosine_and_sine(angle: float) -> tuple[float, float]:
    """Without the rounding of pi where the angle is a twelfth of a turn, or several: cos(pi/2) is
    zero, not 6e-17, or ranks would change.
    """
    cosine, sine = float(np.cos(angle)), float(np.sin(angle))
    twelfth = np.pi / 6
    if abs(angle - round(angle / twelfth) * twelfth) > _WRITTEN:
        return cosine, sine
    return _unrounded_number(cosine), _unrounded_number(sine)


def _unrounded_number(value: float) -> float:
    for exact in _EXACT:
        if abs(abs(value) - exact) <= _WRITTEN:
            return float(np.copysign(exact, value)) if exact else 0.0
    return value


def written_angle(angle: float) -> float:
    """An angle as it is meant: whole quarter turns are exact, rad."""
    quarters = round(angle / (np.pi / 2))
    return quarters * np.pi / 2 if abs(angle - quarters * np.pi / 2) <= _WRITTEN else angle


def whole_quarters(angle: float) -> int | None:
    """How many quarter turns an angle is, None if it is no whole number of them."""
    quarters = round(angle / (np.pi / 2))
    return quarters if abs(angle - quarters * np.pi / 2) <= _ROUNDING else None


def unrounded(rotation: FloatArray) -> FloatArray:
    """A rotation matrix without what rounding left of entries 0 and 1, (3, 3)."""
    nearest = np.round(rotation)
    return np.where(np.abs(rotation - nearest) < _ROUNDING, nearest, rotation)


def rotation_vector(rotation: FloatArray) -> tuple[float, FloatArray]:
    """Angle, 0 to pi rad, and axis, (3,), of a rotation matrix; z where nothing turns."""
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
