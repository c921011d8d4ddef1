"""Operation counts of models that keep some parameters; shared by the stages."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np

from paramreduce_cli.config import Config
from paramreduce_cli.lean.model import LeanModels, ties
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.records import FloatArray, IntArray, Model

COUNTS = (
    "operations_inverse",
    "operations_direct",
    "operations_inverse_plain",
    "operations_direct_plain",
    "operations_inverse_paper_rule",
    "operations_direct_paper_rule",
)
"""What :meth:`Counts.all` counts: lean models, plain recursion, and that by the paper's rule."""


class Counts:
    """Operations of the inverse and direct dynamics; each model is counted once.

    Args:
        config: Says which functions are counted.
        model: Of the mechanism.
    """

    def __init__(self, config: Config, model: Model) -> None:
        self._independent = config.validation.operations == "independent"
        self._model = model
        self._known: dict[bytes, list[int]] = {}

    @cached_property
    def _plain(self) -> Dynamics:
        return Dynamics(self._model.mechanism)

    @cached_property
    def _lean(self) -> LeanModels:
        model = self._model
        return LeanModels(model.mechanism, model.formulations, independent=self._independent)

    def estimate(self, expansion: FloatArray) -> int:
        """Of the lean inverse dynamics, nearly; for criteria, which ask for thousands of models.

        Args:
            expansion: Standard parameters from the values kept, (n_standard, n).
        """
        return self._lean.estimate(kept_and_tied(self._model, expansion)[0])

    def all(self, expansion: FloatArray) -> list[int]:
        """All of :data:`COUNTS`.

        Args:
            expansion: Standard parameters from the values kept, (n_standard, n).
        """
        key = expansion[:, np.lexsort(expansion)].tobytes()
        if key not in self._known:
            kept, same = kept_and_tied(self._model, expansion)
            plain = [
                count
                for signs_free in (True, False)
                for count in self._plain.count_operations(
                    kept, same=same, signs_free=signs_free, independent=self._independent
                )
            ]
            lean = [
                f(kept, same=same).n_operations for f in (self._lean.inverse, self._lean.direct)
            ]
            self._known[key] = lean + plain
        return self._known[key]


def kept_and_tied(model: Model, expansion: FloatArray) -> tuple[IntArray, Mapping[int, int]]:
    """Parameters that are not zero, and which of them have the value of another one.

    Args:
        model: Says which parameters change the torques at all.
        expansion: Standard parameters from the values kept, ones and zeros, (n_standard, n).
    """
    kept, owner = kept_and_owner(model, expansion)
    return kept, ties(kept, owner)


def kept_and_owner(model: Model, expansion: FloatArray) -> tuple[IntArray, IntArray]:
    """Parameters that are not zero, and the column of the expansion that each is the value of.

    Args:
        model: Says which parameters change the torques at all.
        expansion: Standard parameters from the values kept, ones and zeros, (n_standard, n).
    """
    kept = np.flatnonzero(expansion.any(axis=1) & model.affecting)
    if expansion.shape[1] == 0:
        return kept, kept
    return kept, np.argmax(expansion[kept] != 0, axis=1).astype(np.int64)
