"""What the heuristics found, each curve once: those that found the same models share one."""

from dataclasses import dataclass

import numpy as np

from paramreduce_cli.records import HeuristicValidation, ModelChoice
from paramreduce_cli.report.data import ReportData

COLOURS = (
    "#7d8590", "#0b62c4", "#3a88c8", "#8e5bb5", "#d9730d", "#a97a0c", "#2f8f5b", "#c2384f", "#7a6a53",
    "#0b8f8f",
)  # fmt: skip
"""Of heuristics in their order; all of them stand out from white by 3 to 1."""
_MARKERS = ("s", "o", "v", "P", "^", "X", "D", "*", "p")
EQUAL = 1e-4
"""Relative difference of values that single precision and other orders of columns explain."""


@dataclass(frozen=True)
class Curve:
    """One or several heuristics that found the same models at all sizes."""

    names: tuple[str, ...]
    result: HeuristicValidation
    colour: str
    marker: str

    @property
    def label(self) -> str:
        """The names, as a legend has them."""
        return ", ".join(self.names)


def curves(data: ReportData) -> list[Curve]:
    """All heuristics, in their order; colours and markers are the same in all figures."""
    found: list[Curve] = []
    for k, (name, result) in enumerate(data.validation.heuristics.items()):
        for place, other in enumerate(found):
            if _coincide(data, name, other.names[0]):
                found[place] = Curve((*other.names, name), other.result, other.colour, other.marker)
                break
        else:
            colour, marker = COLOURS[k % len(COLOURS)], _MARKERS[k % len(_MARKERS)]
            found.append(Curve((name,), result, colour, marker))
    return found


def _coincide(data: ReportData, one: str, other: str) -> bool:
    sizes = data.validation.heuristics[one].n.tolist()
    return sizes == data.validation.heuristics[other].n.tolist() and all(
        _same(*(_model(data, ModelChoice(name, n)) for name in (one, other))) for n in sizes
    )


def _model(data: ReportData, choice: ModelChoice) -> dict[int, float] | None:
    """Values by column; None where there is no such model."""
    row = choice.row(data.reduction)
    if row is None:
        return None
    found = data.reduction.heuristics[choice.heuristic]
    return dict(zip(found.subsets[row].tolist(), found.parameters[row].tolist(), strict=True))


def _same(one: dict[int, float] | None, other: dict[int, float] | None) -> bool:
    if one is None or other is None:
        return one is other
    return set(one) == set(other) and bool(
        np.allclose([other[k] for k in one], list(one.values()), rtol=EQUAL, atol=0)
    )
