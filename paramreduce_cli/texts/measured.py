"""Values that are known up to a standard deviation."""

import math

_MOST_DECIMALS = 7
"""Digits after the point from which on numbers have exponents."""


def measured(value: float, deviation: float | None) -> tuple[str, str]:
    """A value and its standard deviation with the digits that the latter leaves sure.

    Args:
        value: The value.
        deviation: Two of its digits are told; where there is none, or it is not finite, the value has six.

    Returns:
        Both as text, the second one empty where there is no deviation.
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
