"""Angles that robot files round, restored to exact multiples."""

import math
from decimal import Decimal
from fractions import Fraction

_NOTHING = 1e-9
"""What is left of zero, rad, m or of a direction."""
_CUT_OFF = 3
"""Digits after the point from which on an angle may have been cut off instead of rounded."""
_NEAR = 1.5
"""Units of the last digit within which a number is worth a hint."""
_SLIP = 1e-8
"""Slip of angles with many digits, rad: some files have the last one wrong."""


def unround_angle(text: str) -> float:
    """Return the angle that a number was rounded, or cut off, from, rad.

    The more digits a number has, the finer are the angles that it can stand for: quarter turns with two decimals,
    eighths with three, multiples of 15 degrees with four or more. Numbers with fewer than three digits are not taken
    for truncated.

    Args:
        text: The number as it is written.

    Returns:
        The exact angle, or the number itself where it stands for none.

    Raises:
        ValueError: The text is no number.
    """
    value = float(text)
    if abs(value) < _NOTHING or not math.isfinite(value):
        return 0.0 if math.isfinite(value) else value
    digits, nice = _find_nearest(text)
    if nice is None:
        return value
    unit = 10.0**-digits
    rounded = abs(value - nice) <= max(unit / 2, _SLIP)
    cut_off = digits >= _CUT_OFF and 0 <= abs(nice) - abs(value) < unit
    return nice if rounded or cut_off else value


def find_near_angle(text: str) -> float | None:
    """Return the multiple that a number almost is, rad; None if it is exact or no multiple is near."""
    if not math.isfinite(float(text)):
        return None
    digits, nice = _find_nearest(text)
    off = nice is not None and unround_angle(text) != nice
    return nice if off and abs(float(text) - (nice or 0.0)) <= _NEAR * 10.0**-digits else None


def _find_nearest(text: str) -> tuple[int, float | None]:
    """Return the number of decimals of a number, and the simple fraction of pi that is nearest to the number.

    The fraction is None if the nearest one is zero, or the number has too few decimals.
    """
    digits = -int(Decimal(text.strip()).as_tuple().exponent)
    parts = next((n for least, n in ((4, 12), (3, 4), (2, 2)) if digits >= least), None)
    whole = round(float(text) / (math.pi / parts)) if parts is not None else 0
    return digits, whole * math.pi / parts if parts is not None and whole else None


def clear_rounding(value: float) -> float:
    """Return a number, with mere round-off of zero made zero."""
    return 0.0 if abs(value) < _NOTHING else value


def format_angle(angle: float) -> str:
    """Return an angle as a config writes it, with pi for multiples of 15 degrees."""
    twelfths = round(angle / (math.pi / 12))
    if not twelfths or abs(angle - twelfths * math.pi / 12) > 1e-14 * abs(twelfths):
        return format_number(angle)
    part = Fraction(twelfths, 12)
    over = f"/{part.denominator}" if part.denominator > 1 else ""
    times = {1: "", -1: "-"}.get(part.numerator, f"{part.numerator}*")
    return f"{times}pi{over}"


def format_number(value: float) -> str:
    """Return a number with fourteen digits, as a config writes it."""
    text = f"{value + 0.0:.14g}"
    return (
        text if any(mark in text for mark in ".en") or text.lstrip("-").isdigit() else f"{text}.0"
    )
