"""Operations of the reduced models that people look at: to count those of all takes minutes for large robots."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from paramreduce_cli.lean.counting import Counts, count_all, digest_structure
from paramreduce_cli.records import (
    CountedDynamics,
    HeuristicValidation,
    Model,
    ModelChoice,
    Operations,
    Reduction,
    Run,
)

_FEW = 2_000
"""Models times parameters up to which the operations of all models are counted: about four seconds."""

Heuristics = Mapping[str, HeuristicValidation]


class OperationCounts:
    """A counter of operations of reduced models.

    Args:
        model: Model of the robot.
        counted: Functions that are counted for loops.
        reduction: The reduced models.
        run: Workers and progress.
    """

    def __init__(
        self, model: Model, counted: CountedDynamics, reduction: Reduction, run: Run
    ) -> None:
        self._model, self._counted, self._run = model, counted, run
        self._models = {
            ModelChoice(name, int(n)): reduction.make_model(name, row)
            for name, found in reduction.heuristics.items()
            for row, n in enumerate(found.n)
        }
        self._structures = {key: digest_structure(one, model) for key, one in self._models.items()}

    @property
    def are_few(self) -> bool:
        """Whether all models are counted in a few seconds."""
        return len(set(self._structures.values())) * self._model.values.size <= _FEW

    def estimate(self, heuristics: Heuristics) -> Heuristics:
        """Return the validation of heuristics with approximate numbers of operations for all models."""
        counts = Counts(self._model, self._counted)
        kept = {key: one.standard != 0 for key, one in self._models.items()}
        found = {
            key: (counts.estimate(one), counts.estimate(one, direct=True))
            for key, one in kept.items()
        }
        return _insert_operations(heuristics, found)

    def count(self, heuristics: Heuristics, shown: Sequence[ModelChoice]) -> Heuristics:
        """Return the validation of heuristics with the numbers of operations of some models, and of all that have the
        same structure.
        """
        known = {
            self._structures[key]: (result.operations.inverse[row], result.operations.direct[row])
            for key in self._models
            for result in [heuristics[key.heuristic]]
            for row in [result.find_row(key.n)]
            if row is not None and np.isfinite(result.operations.inverse[row])
        }
        distinct = {self._structures[key]: self._models[key] for key in shown}
        missing = [key for key in distinct if key not in known]
        if missing:
            models = [distinct[key] for key in missing]
            counts = count_all(self._model, self._counted, models, self._run)
            known |= dict(zip(missing, map(tuple, counts.tolist()), strict=True))
        found = {key: known[name] for key, name in self._structures.items() if name in known}
        return _insert_operations(heuristics, found)


def _insert_operations(
    heuristics: Heuristics, operations: Mapping[ModelChoice, tuple[float, ...]]
) -> Heuristics:
    """Return the validation of heuristics with operations by model, NaN for models without."""
    unknown = (np.nan, np.nan)
    found = {}
    for name, result in heuristics.items():
        rows = [operations.get(ModelChoice(name, n), unknown) for n in result.n.tolist()]
        inverse, direct = np.array(rows, dtype=float).reshape(-1, 2).T
        found[name] = replace(result, operations=Operations(inverse, direct))
    return found
