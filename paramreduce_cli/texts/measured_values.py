"""Values with a standard deviation, written with the digits that are certain."""

import math

_MOST_DECIMALS = 7
"""Digits after the point from which on numbers are written with exponents."""


def format_measured(value: float, deviation: float | None) -> tuple[str, str]:
    """Return a value and its standard deviation as text: two significant digits of the deviation, and as many decimals
    of the value.

    Args:
        value: The value.
        deviation: Standard deviation. If it is None, zero or not finite, the value has six significant digits.

    Returns:
        Text of the value and of the deviation, which is empty if there is none.
    """
    if deviation is None:
        return f"{value:.6g}", ""
    if not (math.isfinite(deviation) and deviation > 0):
        return f"{value:.6g}", f"{deviation:.2g}"
    decimals = max(0, 1 - math.floor(math.log10(deviation)))
    if decimals > _MOST_DECIMALS:
        digits = max(1, decimals + math.floor(math.log10(abs(value) or deviation)))
        return f"{value:.{digits}e}", f"{deviation:.1e}"
    return f"{value:.{decimals}f}", f"{deviation:.{decimals}f}"
