"""Text for people: percentages, ranges and formulas."""

import math
from collections.abc import Mapping

EXACT = 1e-10
"""Relative error below which a model counts as exact: round-off of the samples and of a fit together."""
_FAR_OFF = 10.0

_ESCAPES = {
    "\\": r"\textbackslash{}", "%": r"\%", "&": r"\&", "#": r"\#", "$": r"\$", "{": r"\{",
    "}": r"\}", "~": r"\textasciitilde{}", "^": r"\^{}", "_": r"\_", ">": "$>$", "<": "$<$", "|": "$|$", "[": "{[}",
}  # fmt: skip


def format_percent(value: float | None) -> str:
    """Format a fraction in per cent; None stands for infinity."""
    if value is None or not math.isfinite(value):
        return "∞"
    if value >= _FAR_OFF:
        return "> 1000 %"
    return f"{100 * value:.3g} %" if value >= EXACT else "0 %"


def format_percent_range(median: float | None, least: float | None, worst: float | None) -> str:
    """Format the median of errors over motions, with the smallest and the largest in brackets; a dash for no motions."""
    if median is not None and math.isnan(median):
        return "-"
    if format_percent(least) == format_percent(worst):
        return format_percent(median)
    return f"{format_percent(median)} ({format_percent(least).removesuffix(' %')} to {format_percent(worst)})"


def to_latex(text: str, symbols: Mapping[str, str]) -> str:
    """Return a text in LaTeX, with numbers and symbols as formulas.

    Args:
        text: Words, numbers and names, separated by spaces.
        symbols: LaTeX formulas by the name that each replaces.
    """
    return " ".join(_word_to_latex(word, symbols) for word in text.split(" "))


def _word_to_latex(word: str, symbols: Mapping[str, str]) -> str:
    """Return one word in LaTeX: a sign, a symbol with brackets and powers, a number, or escaped text."""
    if word in ("+", "-"):
        return f"${word}$"
    core = word.removeprefix("(").removesuffix(")").removesuffix("^2")
    if core in symbols:
        before, _, after = word.partition(core)
        return f"${before}{symbols[core]}{after}$"
    mantissa, e, exponent = word.partition("e")
    if e and exponent.lstrip("+-").isdecimal() and mantissa.replace(".", "").isdecimal():
        return rf"${mantissa} \cdot 10^{{{int(exponent)}}}$"
    for symbol, formula in _FORMULAS.items():
        word = word.replace(symbol, formula)
    return "".join(_ESCAPES.get(character, character) for character in word).translate(_UNMASKED)


_GREEK = {
    "∞": r"$\infty$",
    "≤": r"$\le$",
    "n_φ": r"$n_\varphi$",
    "κ": r"$\kappa$",
    "ε_τ": r"$\varepsilon_\tau$",
    "ε_z̈": r"$\varepsilon_{\ddot z}$",
    "δ": r"$\delta$",
    "φ'": r"$\varphi'$",
    "²": r"$^2$",
}
_FORMULAS = {symbol: chr(0xE000 + k) for k, symbol in enumerate(_GREEK)}
"""Private-use characters that replace formulas while text is escaped."""
_UNMASKED = {0xE000 + k: formula for k, formula in enumerate(_GREEK.values())}
