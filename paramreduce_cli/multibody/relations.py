"""Regrouping relations between parameters as readable text.

A coefficient that is a simple function of the geometry is printed as such, but only where the
function still fits when the geometry is changed; everything else stays a number.
"""

import itertools
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from paramreduce_cli.records import FloatArray, IntArray

_MATCH = 1e-8
_IGNORED = 1e-10
_COUNTED = 1e-2
"""Share of a sum below which its smallest terms are together counted instead of printed."""
_MOST_PRINTED = 12
"""Terms that are printed at most, the largest."""

Lengths = Mapping[str, float]


def list_functions(lengths: Lengths) -> dict[str, float]:
    """Return simple functions of named lengths by their text, the simplest first."""
    values = {"": 1.0, "2": 2.0}
    for name, value in lengths.items():
        values[name] = value
        values[f"2 {name}"] = 2 * value
        values[f"{name}^2"] = value**2
    for (one, x), (two, y) in itertools.combinations(lengths.items(), 2):
        values[f"{one} {two}"] = x * y
        values[f"2 {one} {two}"] = 2 * x * y
    for count in (2, 3):
        for chosen in itertools.combinations(lengths.items(), count):
            values |= _list_square_sums(chosen)
    return values


def _list_square_sums(lengths: Sequence[tuple[str, float]]) -> dict[str, float]:
    """Return the sums and differences of the squares of some lengths; the first one is positive."""
    result = {}
    for signs in itertools.product((1, -1), repeat=len(lengths) - 1):
        text, value = f"{lengths[0][0]}^2", lengths[0][1] ** 2
        for sign, (name, length) in zip(signs, lengths[1:], strict=True):
            text += f" {'+' if sign > 0 else '-'} {name}^2"
            value += sign * length**2
        result[f"({text})"] = value
    return result


def name_coefficient(values: FloatArray, texts: Sequence[str], functions: FloatArray) -> str | None:
    """Return the text of the function of the geometry that gives a coefficient, with its sign; None if none or several
    do.

    Args:
        values: The coefficient for each of several geometries, (n_geometries,).
        texts: Texts of the functions that the coefficient may be.
        functions: Values of these functions for the same geometries, (n_geometries, n_functions).

    Returns:
        Text such as ``- a_3^2``; None if no function fits all geometries, or more than one does.
    """
    missed = np.abs(functions - np.array([1.0, -1.0])[:, None, None] * values[:, None])
    fits = np.argwhere((missed <= _MATCH * np.abs(functions)).all(axis=1))
    if len(fits) != 1:
        return None
    negative, k = fits[0].tolist()
    return f"{'-' if negative else '+'} {texts[k]}".rstrip()


def format_regrouping(
    names: Sequence[str], kept: IntArray, beta: Sequence[FloatArray], lengths: Sequence[Lengths]
) -> list[str]:
    """Return the base parameters as sums of standard ones.

    Coefficients are written as functions of named lengths where the geometry explains them, else as numbers.

    Args:
        names: Names of all parameters, (n,).
        kept: Columns of the base parameters, (r,).
        beta: Regrouping matrices of several geometries of the same structure, the real one first, each (r, n - r).
        lengths: Lengths of the same geometries, by name.
    """
    found = [list_functions(entry) for entry in lengths]
    texts, functions = list(found[0]), np.array([list(entry.values()) for entry in found])

    def format_term(row: int, column: int) -> str:
        """Return a coefficient as text: a function of lengths, or a number."""
        values = np.array([b[row, column] for b in beta])
        return name_coefficient(values, texts, functions) or format_signed(values[0])

    return _format_expressions(names, kept, beta[0], format_term)


def approximate_expressions(
    names: Sequence[str], kept: IntArray, beta: FloatArray, known_values: FloatArray | None = None
) -> list[str]:
    """Return the approximate base parameters as sums of standard ones with numeric coefficients.

    Put the terms with the largest shares of the value first, and state only the number and the joint share of the
    smallest ones. Without ``known_values``, print all terms in the order of the names.

    Args:
        names: Names of all parameters, (n,).
        kept: Columns of the approximate base parameters, (n_kept,).
        beta: Coefficients of the others in ascending order, (n_kept, n - n_kept).
        known_values: Values of all parameters; without them all terms are printed, in the order of the names.
    """

    def term(i: int, j: int) -> str:
        return format_signed(float(beta[i, j]))

    if known_values is None:
        return _format_expressions(names, kept, beta, term)
    others = np.setdiff1d(np.arange(len(names)), kept)
    parts = np.abs(beta * known_values[others])
    wholes = np.abs(known_values[kept]) + parts.sum(axis=1)
    shares = parts / np.maximum(wholes, np.finfo(float).tiny)[:, None]
    return [
        _format_sum([f"{term(i, j)} {names[k]}" for j, k in enumerate(others)], own, names[column])
        for i, (column, own) in enumerate(zip(kept, shares, strict=True))
    ]


def _format_sum(terms: Sequence[str], coefficients: FloatArray, first: str) -> str:
    """Return a sum with its largest terms first; of the smallest terms only the number and the joint share in percent
    are given.

    Args:
        terms: Terms with their signs.
        coefficients: Contribution of each term to the whole, (n_terms,).
        first: Text that the sum is added to.
    """
    order = np.argsort(-coefficients, kind="stable")
    remaining = coefficients[order][::-1].cumsum()[::-1]
    printed = min(int((remaining >= _COUNTED).sum()), _MOST_PRINTED)
    text = " ".join([first, *(terms[k] for k in order[:printed])])
    small = int((coefficients[order[printed:]] > _IGNORED).sum())
    if not small:
        return text
    them = "1 smaller term" if small == 1 else f"{small} smaller terms, together"
    return f"{text} and {them} {100 * remaining[printed]:.1g} %"


def format_signed(value: float) -> str:
    """Return a number with its sign, such as ``- 0.4318``; a factor of 1 is left out."""
    if abs(abs(value) - 1.0) <= _MATCH:
        return "-" if value < 0 else "+"
    return f"{'-' if value < 0 else '+'} {abs(value):.6g}"


def _format_expressions(
    names: Sequence[str], kept: IntArray, beta: FloatArray, term: Callable[[int, int], str]
) -> list[str]:
    """Return the base parameters as sums of standard parameters."""
    others = [names[k] for k in np.setdiff1d(np.arange(len(names)), kept)]
    result = []
    for i, column in enumerate(kept):
        used = np.flatnonzero(np.abs(beta[i]) > _IGNORED).tolist()
        result.append(" ".join([names[column], *(f"{term(i, j)} {others[j]}" for j in used)]))
    return result
