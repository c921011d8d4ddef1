"""Sines and cosines of exported code: constants of a routine without branches, which vectorises and is inlined.

An angle is j pi/2 + r with |r| <= pi/4; pi/2 is taken off in parts whose first ones have so few digits
that their products with j are exact. With w = r^2, sin r = r + r w S(w) and cos r = 1 - w/2 + w^2 C(w),
where S and C have the least largest error on [0, (pi/4)^2] (Remez's exchange in 50 digits).
"""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Sines:
    """The constants for one precision."""

    magic: float
    """Adding it and taking it off rounds to whole numbers."""
    limit: float
    """Angles beyond it go to the library, rad."""
    parts: tuple[float, ...]
    """Parts of pi/2, large ones first."""
    sine: tuple[float, ...]
    """S, constant term first; it is off by 3e-18, single 4e-9."""
    cosine: tuple[float, ...]
    """C, by 5e-20, single 1e-10."""


DOUBLE = Sines(
    magic=1.5 * 2**52,
    limit=1e5,
    parts=(1.5707963267341256, 6.077100506506192e-11),
    sine=(
        -0.16666666666666632, 0.008333333333322418, -0.00019841269829812394, 2.7557313693577036e-06,
        -2.5050758384966687e-08, 1.5896811828603712e-10,
    ),
    cosine=(
        0.0416666666666666, -0.0013888888888874131, 2.4801587289487016e-05, -2.755731435379063e-07,
        2.08757234793286e-09, -1.135965886291983e-11,
    ),
)  # fmt: skip
SINGLE = Sines(
    magic=1.5 * 2**23,
    limit=3e3,
    parts=(1.5703125, 4.837512969970703e-4, 7.549789954891882e-08),
    sine=(-0.1666665494019952, 0.008332177916359453, -0.0001951726684099064),
    cosine=(0.041666646860525486, -0.0013887367212939566, 2.4438415537768046e-05),
)


def write_polynomial(coefficients: Sequence[str]) -> str:
    """Return a polynomial in w by even and odd powers, so that few operations wait for each other.

    Args:
        coefficients: Coefficients as text, constant term first.
    """
    even, odd = _write_horner(coefficients[::2]), _write_horner(coefficients[1::2])
    return f"{even} + w * {odd}"


def _write_horner(coefficients: Sequence[str]) -> str:
    """Return Horner's scheme in w2, the square of w, as text."""
    *lower, text = coefficients
    for one in reversed(lower):
        text = f"({one} + w2 * {text})"
    return text
