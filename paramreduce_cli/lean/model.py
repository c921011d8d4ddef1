"""Lean models of a mechanism: the leanest formulation for a set of parameters, as a program."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import TYPE_CHECKING

import numpy as np

from paramreduce_cli.expressions.factoring import Values, minimise_operations
from paramreduce_cli.expressions.graph import ZERO, Graph
from paramreduce_cli.expressions.operations import Program
from paramreduce_cli.lean.building import Build, direct_outputs, inverse_outputs
from paramreduce_cli.lean.choices import from_data
from paramreduce_cli.lean.projection import projected_direct, projected_inverse
from paramreduce_cli.lean.tree import lean_tree
from paramreduce_cli.records import BoolArray, Formulation, IntArray, Mechanism, Model, ReducedModel

if TYPE_CHECKING:
    from paramreduce_cli.expressions.live import LiveCount

_NEAR = 1.02
"""Estimates further apart than that are not the wrong way round."""


@dataclass
class _Variants:
    """The same model in all formulations."""

    programs: list[Program]

    @cached_property
    def _counts(self) -> list[LiveCount]:
        from paramreduce_cli.expressions.live import LiveCount  # Numba is slow to load

        return [LiveCount(program) for program in self.programs]

    def estimates(self, zero: BoolArray) -> list[int]:
        """Operations of each, nearly, with some parameters zero."""
        return [count(zero) for count in self._counts]

    def promising(self, zero: BoolArray) -> list[int]:
        """Numbers of those that may turn out to be the leanest."""
        estimates = self.estimates(zero)
        most = _NEAR * min(estimates)
        return [k for k, count in enumerate(estimates) if count <= most]


def lean_models(model: Model, *, independent: bool = False) -> LeanModels:
    """Return the lean models of a robot.

    Those of the robots asked for last are kept: all formulations of an arm of six joints take half a second to write.

    Args:
        model: Model of the robot, with formulations to choose from.
        independent: See :class:`LeanModels`.
    """
    return _kept_lean_models(_SameModel(model), independent)


@dataclass(frozen=True, eq=False)
class _SameModel:
    """A model that equals itself alone, as arrays cannot be hashed."""

    model: Model

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _SameModel) and other.model is self.model

    def __hash__(self) -> int:
        return id(self.model)


@lru_cache(2)
def _kept_lean_models(same: _SameModel, independent: bool) -> LeanModels:
    return LeanModels(same.model, independent=independent)


class LeanModels:
    """Programs of the inverse and direct dynamics for any set of parameters.

    Their inputs are the standard parameters, then q, dq and ddq, and for loops, if the independent
    coordinates are asked for, the dependent rows of R, row by row, and of b.

    Args:
        model: Of the robot, with formulations to choose from.
        independent: Whether d_z and [M_zz | delta_z] are meant, with R and b handed in, instead of
            d_q and [M_qq | delta_q]; on an open tree they are the same.
    """

    def __init__(self, model: Model, *, independent: bool = False) -> None:
        mechanism = model.mechanism
        self._model, self.mechanism = model, mechanism
        self._useless = frozenset(np.flatnonzero(~model.affecting).tolist())
        self._tree = lean_tree(mechanism)
        self._projected = independent and mechanism.loops is not None
        self.n_parameters = mechanism.n_parameters

    def __reduce__(self) -> tuple[Callable[..., LeanModels], tuple[Model]]:
        # Other processes work out again what they need: that takes less than being told.
        return partial(LeanModels, independent=self._projected), (self._model,)

    @cached_property
    def _inverse(self) -> _Variants:
        return self._variants(inverse_outputs, self.formulations(), projected_inverse)

    @cached_property
    def _direct(self) -> _Variants:
        return self._variants(direct_outputs, self.formulations(direct=True), projected_direct)

    def _variants(
        self,
        build: Build,
        formulations: tuple[Formulation, ...],
        project: Callable[[Mechanism, Graph, Sequence[int]], list[int]],
    ) -> _Variants:
        programs = []
        for formulation in formulations:
            graph = Graph()
            at_joints = [from_data(data) for data in formulation]
            outputs = build(self._tree, at_joints, graph, self._useless)
            if self._projected:
                outputs = project(self.mechanism, graph, outputs)
            programs.append(Program.from_graph(*Values(graph, outputs).simplify()))
        return _Variants(programs)

    def inverse(
        self, model: ReducedModel, *, constant: bool = False, rewritten: bool = True
    ) -> Program:
        """The inverse dynamics of a model; the torques, (n_q,) or (n_dof,).

        Args:
            model: Which parameters are kept, and which have one value.
            constant: Whether their values are known, and so part of the program.
            rewritten: Whether it is rewritten as far as that saves operations.
        """
        return self._leanest(self._inverse, model, constant, rewritten)

    def direct(
        self, model: ReducedModel, *, constant: bool = False, rewritten: bool = True
    ) -> Program:
        """[M | delta] of a model: the lower triangle of M, row by row, then delta.

        Args:
            model: Which parameters are kept, and which have one value.
            constant: Whether their values are known, and so part of the program.
            rewritten: Whether it is rewritten as far as that saves operations.
        """
        return self._leanest(self._direct, model, constant, rewritten)

    def formulation(self, model: ReducedModel, *, direct: bool = False) -> Formulation:
        """The one with the fewest operations before they are rewritten."""
        variants = self._direct if direct else self._inverse
        _, number = self._settled(variants, model, constant=False)
        return self.formulations(direct=direct)[number]

    def formulations(self, *, direct: bool = False) -> tuple[Formulation, ...]:
        """All that there are."""
        known = self._model.formulations
        return known.direct if direct else known.inverse

    def alone(self, formulation: Formulation, *, direct: bool = False) -> LeanModels:
        """The same in one formulation of the inverse or of the direct dynamics."""
        known = self._model.formulations
        if direct:
            found = replace(known, direct=(formulation,))
        else:
            found = replace(known, inverse=(formulation,))
        return LeanModels(replace(self._model, formulations=found), independent=self._projected)

    def estimate(self, kept: IntArray, *, direct: bool = False) -> int:
        """Operations, nearly: quick enough to compare thousands of subsets.

        Args:
            kept: Indices of the parameters that are not zero.
            direct: Whether those of the direct dynamics are meant, not of the inverse.
        """
        variants = self._direct if direct else self._inverse
        return min(variants.estimates(self._dropped(kept)))

    def _dropped(self, kept: IntArray) -> BoolArray:
        zero = np.ones(self.n_parameters, dtype=np.bool_)
        zero[kept] = False
        return zero

    def _leanest(
        self, variants: _Variants, model: ReducedModel, constant: bool, rewritten: bool
    ) -> Program:
        """The formulation with the fewest operations."""
        if not rewritten:
            return Program.from_graph(*self._settled(variants, model, constant)[0])
        return Program.from_graph(
            *minimise_operations(self._promising(variants, model, constant).values())
        )

    def _settled(
        self, variants: _Variants, model: ReducedModel, constant: bool
    ) -> tuple[Values, int]:
        """The same before it is rewritten, and its number."""
        ways = self._promising(variants, model, constant)
        settled = [(way.simplify(), number) for number, way in ways.items()]
        return min(settled, key=lambda way: way[0].n_operations)

    def _promising(
        self, variants: _Variants, model: ReducedModel, constant: bool
    ) -> dict[int, Values]:
        """What may turn out to be the leanest, by number of the formulation."""
        numbers = variants.promising(self._dropped(model.kept))
        return {k: self._written(variants.programs[k], model, constant) for k in numbers}

    def _written(self, program: Program, model: ReducedModel, constant: bool) -> Values:
        """A formulation for a model, without what is zero then."""
        ties, values = model.ties, model.standard
        kept = frozenset(model.kept.tolist())
        graph = Graph()

        def substitute(position: int) -> int:
            if position >= self.n_parameters:
                return graph.input(position)
            if position not in kept:
                return ZERO
            if constant:
                return graph.constant(float(values[position]))
            return graph.input(ties.get(position, position))

        return Values(graph, program.rebuild(graph, substitute))
