"""Angles that files round, taken for what they were."""

import math
from decimal import Decimal
from fractions import Fraction

_NOTHING = 1e-9
"""What is left of zero, rad, m or of a direction."""
_SLIP = 1e-8
"""Of angles with many digits, rad: some files have the last one wrong."""


def meant(text: str) -> float:
    """The angle that a number was rounded, or cut off, from, rad.

    The more digits it has the finer the angles it can stand for: quarter turns with two digits after
    the point, eighths with three, multiples of 15 degrees with four or more.

    Args:
        text: The number as it is written.

    Raises:
        ValueError: It is no number.
    """
    value = float(text)
    if abs(value) < _NOTHING or not math.isfinite(value):
        return 0.0 if math.isfinite(value) else value
    digits = -int(Decimal(text.strip()).as_tuple().exponent)
    parts = next((n for least, n in ((4, 12), (3, 4), (2, 2)) if digits >= least), None)
    if parts is None:
        return value
    whole = round(value / (math.pi / parts))
    nice = whole * math.pi / parts
    return nice if whole and abs(value - nice) <= max(10.0**-digits, _SLIP) else value


def without_dust(value: float) -> float:
    """A number, zero where it is but round-off of zero."""
    return 0.0 if abs(value) < _NOTHING else value


def angle_text(angle: float) -> str:
    """An angle as a config writes it, multiples of 15 degrees with pi."""
    twelfths = round(angle / (math.pi / 12))
    if not twelfths or abs(angle - twelfths * math.pi / 12) > 1e-14 * abs(twelfths):
        return number_text(angle)
    part = Fraction(twelfths, 12)
    over = f"/{part.denominator}" if part.denominator > 1 else ""
    times = {1: "", -1: "-"}.get(part.numerator, f"{part.numerator}*")
    return f"{times}pi{over}"


def number_text(value: float) -> str:
    """A number with fourteen digits, as a config writes it."""
    text = f"{value + 0.0:.14g}"
    return (
        text if any(mark in text for mark in ".en") or text.lstrip("-").isdigit() else f"{text}.0"
    )
