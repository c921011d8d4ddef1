"""Homogeneous transforms, with the sines and cosines of common angles without rounding."""

from __future__ import annotations

import numpy as np

from paramreduce_cli.records import FloatArray

_EXACT = (0.0, 0.5, 1.0)
_SNAP = 1e-10
"""Angles written with ten digits or more are meant to be what they are near to."""


def rotation_x(angle: float) -> FloatArray:
    """Homogeneous rotation about x, (4, 4)."""
    c, s = _exact(np.cos(angle)), _exact(np.sin(angle))
    return np.array([[1.0, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1]])


def rotation_y(angle: float) -> FloatArray:
    """Homogeneous rotation about y, (4, 4)."""
    c, s = _exact(np.cos(angle)), _exact(np.sin(angle))
    return np.array([[c, 0, s, 0], [0, 1.0, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1]])


def rotation_z(angle: float) -> FloatArray:
    """Homogeneous rotation about z, (4, 4)."""
    c, s = _exact(np.cos(angle)), _exact(np.sin(angle))
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])


def translation(x: float, y: float, z: float) -> FloatArray:
    """Homogeneous translation in m, (4, 4)."""
    result = np.eye(4)
    result[:3, 3] = x, y, z
    return result


def _exact(value: float) -> float:
    """Undo the rounding of pi: cos(pi/2) is zero, not 6e-17, or ranks would change."""
    for exact in _EXACT:
        if abs(abs(value) - exact) <= _SNAP:
            return float(np.copysign(exact, value)) if exact else 0.0
    return float(value)
