"""Subsets of parameters from which searches for negligible terms start."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, zip_longest

import numpy as np

from paramreduce_cli.expressions.programs import Program
from paramreduce_cli.lean.formulations import vary_formulation
from paramreduce_cli.lean.lean_models import LeanModels
from paramreduce_cli.records import Formulation, Model, ReducedModel, Reduction

_NEAR = 8
"""Parameters more than the smallest subset has, up to which all subsets are starts."""
_FAR = (12, 16, 20)
"""Parameters more, of which the leanest and the most exact subset are."""
_OTHER = 0.2
"""How often another subset is gone down from in a formulation that suits one."""


@dataclass(frozen=True, eq=False)
class Start:
    """A reduced model whose terms are to be removed."""

    heuristic: str
    model: ReducedModel
    torque_error: float
    """Torque error on the estimation set."""
    cost: int
    """Operations, nearly."""
    formulation: Formulation | None = None
    """Formulation of the start; None for the leanest."""

    def build_program(self, lean: LeanModels, *, direct: bool) -> Program:
        """Return the program with all terms, not rewritten; its first inputs are the parameters of the model."""
        if self.formulation is not None:
            lean = lean.restrict_to(self.formulation, direct=direct)
        program = (lean.build_direct if direct else lean.build_inverse)(self.model, rewritten=False)
        n, n_standard, place = self.model.n, lean.n_parameters, self.model.position
        return program.renumber(lambda k: k - n_standard + n if k >= n_standard else int(place[k]))


def list_starts(
    torque_error: float, lean: LeanModels, model: Model, reduction: Reduction, *, direct: bool
) -> list[Start]:
    """Return the subsets within the budget on the estimation set, by size, and those of one size by operations.

    Args:
        torque_error: Torque error that is allowed on the estimation set.
        lean: Lean models of the robot, which count operations.
        model: Model of the robot.
        reduction: Reduction whose subsets are candidates.
        direct: Whether operations of the direct dynamics are counted.
    """
    entries: dict[frozenset[str], Start] = {}
    for name, found in reduction.heuristics.items():
        for row in np.flatnonzero(found.torque_error <= torque_error).tolist():
            chosen = reduction.make_model(name, row).drop_unaffecting(model.affecting)
            key = frozenset(chosen.names)
            if found.n[row] <= reduction.rank and key not in entries:
                cost = lean.estimate_operations(chosen.kept, direct=direct)
                entries[key] = Start(name, chosen, float(found.torque_error[row]), cost)
    return sorted(
        entries.values(), key=lambda start: (start.model.n, start.cost, start.torque_error)
    )


def order_by_estimate(starts: list[Start], smallest: int) -> Iterator[Start]:
    """Yield starts, the most promising first: the leanest of every size, then the second of every size, and so on.

    The additional terms of a larger subset may cost little after pruning, and may allow to remove others.

    Args:
        starts: Starts from :func:`list_starts`.
        smallest: Number of parameters from which subsets are taken.
    """
    sizes: dict[int, list[Start]] = defaultdict(list)
    for start in starts:
        sizes[start.model.n].append(start)
    near = [sizes[n] for n in sorted(sizes) if smallest <= n <= smallest + _NEAR]
    far = [
        list(dict.fromkeys((sizes[n][0], min(sizes[n], key=lambda start: start.torque_error))))
        for n in sorted(sizes)
        if n - smallest in _FAR
    ]
    return (start for start in chain(*zip_longest(*near, *far)) if start is not None)


def vary_start(
    start: Start,
    others: Sequence[Start],
    lean: LeanModels,
    rng: np.random.Generator,
    *,
    direct: bool,
) -> Start:
    """Return a start near another one: its formulation is varied, and sometimes its subset is replaced.

    Which formulation takes the fewest operations after pruning cannot be predicted.

    Args:
        start: Start to vary.
        others: Starts whose subsets and formulations may be used instead.
        lean: Lean models of the robot, with the formulations to choose from.
        rng: Random generator.
        direct: Whether [M | delta] is meant, not torques.
    """
    formulation = start.formulation or lean.choose_formulation(start.model, direct=direct)
    known = [
        *lean.get_formulations(direct=direct),
        *(o.formulation for o in others if o.formulation),
    ]
    found = vary_formulation(formulation, known, lean.mechanism, rng)
    subset = others[int(rng.integers(len(others)))] if rng.random() < _OTHER else start
    return replace(subset, formulation=found)
