"""Operation counts of reduced models."""

from collections.abc import Sequence
from functools import cached_property, partial

import numpy as np

from paramreduce_cli.lean.lean_models import LeanModels, get_lean_models
from paramreduce_cli.multibody.textbook_dynamics import PlainDynamics
from paramreduce_cli.records import (
    BoolArray,
    CountedDynamics,
    IntArray,
    Model,
    Progress,
    ReducedModel,
    Run,
)
from paramreduce_cli.resources.processes import start_workers

COUNTS = ("operations_inverse", "operations_direct")
"""Names of the counts of lean models, which :meth:`Counts.count_lean` returns in this order."""
TEXTBOOK_COUNTS = (
    "operations_inverse_plain",
    "operations_direct_plain",
    "operations_inverse_paper_rule",
    "operations_direct_paper_rule",
)
"""Names of the counts of textbook recursion, without and with sign changes, which :meth:`Counts.count_textbook` returns."""
_MANY = 5_000
"""Models times parameters, from which on the start of processes pays: an arm of six joints takes 2 ms a parameter, a process 4 s."""
_AT_ONCE = 8
"""Models that a process counts before it tells."""


class Counts:
    """Operation counts of the inverse and direct dynamics of reduced models.

    Args:
        model: Model of the robot.
        counted: Functions that are counted where the mechanism has loops.
    """

    def __init__(self, model: Model, counted: CountedDynamics) -> None:
        self._independent = counted is CountedDynamics.INDEPENDENT
        self._model = model

    @cached_property
    def _make_textbook(self) -> PlainDynamics:
        return PlainDynamics(self._model.mechanism)

    @cached_property
    def _lean(self) -> LeanModels:
        return get_lean_models(self._model, independent=self._independent)

    def estimate(self, kept: BoolArray, *, direct: bool = False) -> int:
        """Return about how many operations the lean inverse dynamics take, within microseconds.

        Args:
            kept: Mask of the standard parameters that are not zero, (n_standard,).
            direct: Whether the direct dynamics is meant instead.
        """
        indices: IntArray = (kept & self._model.affecting).nonzero()[0]
        return self._lean.estimate_operations(indices, direct=direct)

    def count_lean(self, model: ReducedModel) -> list[int]:
        """Return :data:`COUNTS` of a model; its values do not matter."""
        model = model.drop_unaffecting(self._model.affecting)
        return [f(model).n_operations for f in (self._lean.build_inverse, self._lean.build_direct)]

    def count_textbook(self, model: ReducedModel) -> list[int]:
        """Return :data:`TEXTBOOK_COUNTS` of a model; its values do not matter."""
        model = model.drop_unaffecting(self._model.affecting)
        return [
            count
            for signs_free in (True, False)
            for count in self._make_textbook.count_operations(
                model, signs_free=signs_free, independent=self._independent
            )
        ]


def count_all(
    model: Model, counted: CountedDynamics, chosen: Sequence[ReducedModel], run: Run
) -> IntArray:
    """Count :data:`COUNTS` of many models; models that differ in values alone are counted once.

    Args:
        model: Model of the robot.
        counted: Functions that are counted for loops.
        chosen: The models.
        run: Workers, who are asked where it takes long, and progress.

    Returns:
        (n_models, 2)
    """
    keys = [digest_structure(one, model) for one in chosen]
    different = dict(zip(keys, chosen, strict=True))
    tasks = list(different.items())
    known: dict[bytes, list[int]] = {}
    pays = len(tasks) * model.mechanism.n_parameters >= _MANY
    size = _AT_ONCE if pays else 1
    chunks = [tasks[k : k + size] for k in range(0, len(tasks), size)]
    jobs = min(run.jobs, len(chunks)) if pays else 1
    run.progress(Progress("count operations", 0, len(tasks)))
    with start_workers(jobs, partial(Counts, model, counted)) as pool:
        for _, found in pool.map_unordered(_count, chunks):
            known |= found
            run.progress(Progress("count operations", len(known), len(tasks)))
    return np.array([known[key] for key in keys], dtype=np.int64)


def digest_structure(reduced: ReducedModel, model: Model) -> bytes:
    """Return a digest of what the number of operations depends on: which parameters are kept, and which share a value."""
    reduced = reduced.drop_unaffecting(model.affecting)
    ties = reduced.ties
    return bytes(str([ties.get(k, k) for k in reduced.kept.tolist()]), "ascii")


def _count(counts: Counts, chunk: list[tuple[bytes, ReducedModel]]) -> dict[bytes, list[int]]:
    """Count the models of a chunk, by structure."""
    return {structure: counts.count_lean(one) for structure, one in chunk}
