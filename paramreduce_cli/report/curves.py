"""What the heuristics found, each curve once: those that found the same models share one."""

from dataclasses import dataclass, replace

import numpy as np

from paramreduce_cli.records import BoolArray, FloatArray, HeuristicValidation, ModelChoice
from paramreduce_cli.report.data import ReportData

COLOURS = ("#6a002a", "#1500bf", "#954000", "#00956a", "#aa15ea", "#ff2a15", "#ff40bf", "#006a6a")
"""Colours of curves on white; any two differ by a CIEDE2000 distance of 20, also for deuteranopes."""
DARK_COLOURS = (
    "#ffff15",
    "#5555ff",
    "#ff6a00",
    "#008000",
    "#ff55ff",
    "#ff0080",
    "#00ffd4",
    "#2a8080",
)
"""Colours of the same curves on a dark page, as far apart."""
MARKERS = ("s", "o", "v", "P", "^", "X", "D", "*", "p")
EQUAL = 1e-4
"""Relative difference of values that single precision and other orders of columns explain."""


@dataclass(frozen=True)
class Curve:
    """One or several heuristics that found the same models at all sizes."""

    names: tuple[str, ...]
    result: HeuristicValidation
    colour: str
    dark_colour: str
    """Colour on a dark page."""
    marker: str
    own: BoolArray
    """Mask of the rows to draw: rows that no earlier curve has, and their neighbours, (n_rows,)."""

    def hide_shared(self, values: FloatArray) -> FloatArray:
        """Return values of all rows, NaN where an earlier curve has the same models."""
        return np.where(self.own, values, np.nan)

    @property
    def label(self) -> str:
        """Names of the heuristics, for a legend."""
        return ", ".join(self.names)


def gather_curves(data: ReportData) -> list[Curve]:
    """Return a curve of error against size for each heuristic, in their order; heuristics with the same models share
    one curve.
    """
    found: list[Curve] = []
    seen: dict[int, list[_Values]] = {}
    models: list[list[_Values]] = []
    for name, result in data.validation.heuristics.items():
        sizes = result.n.tolist()
        own = [_find_values(data, ModelChoice(name, n)) for n in sizes]
        place = _find_same_curve(own, sizes, found, models)
        if place is not None:
            found[place] = replace(found[place], names=(*found[place].names, name))
            continue
        fresh = [
            values is None or not any(_is_same(values, other) for other in seen.get(n, ()))
            for n, values in zip(sizes, own, strict=True)
        ]
        for n, values in zip(sizes, own, strict=True):
            seen.setdefault(n, []).append(values)
        models.append(own)
        k = len(found)
        colours = COLOURS[k % len(COLOURS)], DARK_COLOURS[k % len(DARK_COLOURS)]
        marker = MARKERS[k % len(MARKERS)]
        found.append(Curve((name,), result, *colours, marker, _mark_neighbours(np.array(fresh))))
    return found


_Values = dict[int, float] | None
"""Values of a model by column; None where there is no such model."""


def _find_same_curve(
    values: list[_Values], sizes: list[int], curves: list[Curve], models: list[list[_Values]]
) -> int | None:
    """Return the position of the curve with the same models; None if there is none."""
    for place, (curve, others) in enumerate(zip(curves, models, strict=True)):
        if curve.result.n.tolist() == sizes and all(map(_is_same, values, others)):
            return place
    return None


def _mark_neighbours(fresh: BoolArray) -> BoolArray:
    """Return a mask with the neighbours of marked rows marked too, so that lines reach the point where curves meet."""
    result = fresh.copy()
    result[1:] |= fresh[:-1]
    result[:-1] |= fresh[1:]
    return result


def _find_values(data: ReportData, choice: ModelChoice) -> _Values:
    """Return the values of a model by parameter; None if the model does not exist."""
    row = choice.find_row(data.reduction)
    if row is None:
        return None
    found = data.reduction.heuristics[choice.heuristic]
    return dict(zip(found.subsets[row].tolist(), found.parameters[row].tolist(), strict=True))


def _is_same(first: _Values, second: _Values) -> bool:
    """Return whether two models have the same parameters and values."""
    if first is None or second is None:
        return first is second
    return set(first) == set(second) and bool(
        np.allclose([second[k] for k in first], list(first.values()), rtol=EQUAL, atol=0)
    )
