"""Operation counts of reduced models."""

from functools import cached_property

from paramreduce_cli.lean.model import LeanModels
from paramreduce_cli.multibody.plain import PlainDynamics
from paramreduce_cli.records import BoolArray, CountedDynamics, IntArray, Model, ReducedModel

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
        model: Of the robot.
        counted: Which functions are counted where there are loops.
    """

    def __init__(self, model: Model, counted: CountedDynamics) -> None:
        self._independent = counted is CountedDynamics.INDEPENDENT
        self._model = model
        self._known: dict[bytes, list[int]] = {}

    @cached_property
    def _plain(self) -> PlainDynamics:
        return PlainDynamics(self._model.mechanism)

    @cached_property
    def _lean(self) -> LeanModels:
        model = self._model
        return LeanModels(model.mechanism, model.formulations, independent=self._independent)

    def estimate(self, kept: BoolArray) -> int:
        """Of the lean inverse dynamics, nearly; for criteria, which ask for thousands of models.

        Args:
            kept: Which standard parameters are not zero, (n_standard,).
        """
        indices: IntArray = (kept & self._model.affecting).nonzero()[0]
        return self._lean.estimate(indices)

    def all(self, model: ReducedModel) -> list[int]:
        """All of :data:`COUNTS`; the values of a model do not matter."""
        model = model.restricted(self._model.affecting)
        ties = model.ties
        key = bytes(str([ties.get(k, k) for k in model.kept.tolist()]), "ascii")
        if key not in self._known:
            plain = [
                count
                for signs_free in (True, False)
                for count in self._plain.count_operations(
                    model, signs_free=signs_free, independent=self._independent
                )
            ]
            lean = [f(model).n_operations for f in (self._lean.inverse, self._lean.direct)]
            self._known[key] = lean + plain
        return self._known[key]
