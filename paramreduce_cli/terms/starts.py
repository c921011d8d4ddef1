"""Subsets of parameters from which terms are left out."""

from dataclasses import dataclass

import numpy as np

from paramreduce_cli.lean.model import LeanModels
from paramreduce_cli.records import Model, ReducedModel, Reduction

_MORE = (8, 20)
"""Parameters that larger subsets have besides those of the smallest one within the budget."""


@dataclass(frozen=True)
class Start:
    """A reduced model to leave terms of out of."""

    heuristic: str
    model: ReducedModel


def starts_within(
    torque_error: float, lean: LeanModels, model: Model, reduction: Reduction, *, direct: bool
) -> tuple[list[Start], list[Start]]:
    """Subsets within the budget on the estimation set.

    What larger ones have besides may cost little once terms are left out, and make up for these.

    Args:
        torque_error: Allowed on the estimation set.
        lean: Counts operations.
        model: Of the robot.
        reduction: The subsets.
        direct: Whether operations of the direct dynamics count.

    Returns:
        All of them, those of the fewest operations first; and of some larger sizes the leanest and the most
        exact ones.
    """
    entries: dict[frozenset[str], tuple[int, float, Start]] = {}
    for name, found in reduction.heuristics.items():
        for row in np.flatnonzero(found.torque_error <= torque_error).tolist():
            chosen = reduction.model(name, row).restricted(model.affecting)
            key = frozenset(chosen.names)
            if found.n[row] <= reduction.rank and key not in entries:
                cost = lean.estimate(chosen.kept, direct=direct)
                entries[key] = cost, float(found.torque_error[row]), Start(name, chosen)
    if not entries:
        return [], []
    every = list(entries.values())
    smallest = min(start.model.n for _, _, start in every)
    larger = []
    for more in _MORE:
        off = min(abs(start.model.n - smallest - more) for _, _, start in every)
        near = [e for e in every if abs(e[2].model.n - smallest - more) == off]
        larger += [min(near, key=lambda e: e[0])[2], min(near, key=lambda e: e[1])[2]]
    leanest = [start for _, _, start in sorted(every, key=lambda e: (e[0], e[1]))]
    return leanest, list({id(start): start for start in larger}.values())
