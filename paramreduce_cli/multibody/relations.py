"""Linear relations between parameters as readable text.

Coefficients that are a simple function of the geometry are printed as such, but only where
one function alone fits to rounding; anything doubtful stays a number.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from paramreduce_cli.records import FloatArray, IntArray

_MATCH = 1e-9
_IGNORED = 1e-10


class Geometry:
    """Names for numbers that are products and sums of squares of the mechanism's lengths."""

    def __init__(self, lengths: Mapping[str, float]) -> None:
        values: dict[str, float] = {}
        for name, value in lengths.items():
            values[name] = value
            values[f"2 {name}"] = 2 * value
            values[f"{name}^2"] = value**2
        for (one, x), (two, y) in itertools.combinations(lengths.items(), 2):
            values[f"{one} {two}"] = x * y
            values[f"2 {one} {two}"] = 2 * x * y
            values[f"({one}^2 + {two}^2)"] = x**2 + y**2
        self._values = values

    def factor(self, number: float) -> str:
        """Text for a positive number: a function of the lengths, a whole number, or its digits."""
        if abs(number - round(number)) < _MATCH and round(number) != 0:
            return f"{round(number)}"
        matches = [
            name
            for name, value in self._values.items()
            if abs(abs(value) - number) <= _MATCH * number
        ]
        if len(matches) != 1:
            return f"{number:.6g}"
        name = matches[0]
        return name if self._values[name] > 0 else f"(-{name})"


def linear_expression(
    lead: str, names: Sequence[str], coefficients: Iterable[float], geometry: Geometry
) -> str:
    """``lead + c1 name1 - c2 name2 ...`` without the terms that vanish."""
    text = lead
    for name, coefficient in zip(names, coefficients, strict=True):
        if abs(coefficient) <= _IGNORED:
            continue
        factor = geometry.factor(abs(coefficient))
        shown = name if factor == "1" else f"{factor} {name}"
        text += f" {'-' if coefficient < 0 else '+'} {shown}"
    return text


def expressions(
    names: Sequence[str],
    kept: IntArray,
    beta: FloatArray,
    lengths: Mapping[str, float],
    known: FloatArray | None = None,
) -> list[str]:
    """Each kept parameter with what it takes over from the others.

    Args:
        names: Of all parameters, (n,).
        kept: Their columns, (r,).
        beta: Coefficients of the others in ascending order, (r, n - r).
        lengths: Of the mechanism, by name; empty for plain numbers.
        known: Values of all parameters; terms of others that are zero are then left out.
    """
    geometry = Geometry(lengths)
    others = np.setdiff1d(np.arange(len(names)), kept)
    if known is not None:
        used = known[others] != 0
        others, beta = others[used], beta[:, used]
    other_names = [names[k] for k in others]
    return [
        linear_expression(names[column], other_names, row, geometry)
        for column, row in zip(kept, beta, strict=True)
    ]
