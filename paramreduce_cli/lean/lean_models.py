"""Lean models of a mechanism: the leanest formulation for a set of parameters, as a program."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import TYPE_CHECKING

import numpy as np

from paramreduce_cli.expressions.factoring import Values, minimise_operations
from paramreduce_cli.expressions.graph import ZERO, Graph
from paramreduce_cli.expressions.programs import Program
from paramreduce_cli.lean.algebra import forget
from paramreduce_cli.lean.joint_formulations import from_data
from paramreduce_cli.lean.joint_frames import choose_frames
from paramreduce_cli.lean.lean_outputs import Build, build_direct_outputs, build_inverse_outputs
from paramreduce_cli.lean.loop_projection import project_direct_outputs, project_inverse_outputs
from paramreduce_cli.records import BoolArray, Formulation, IntArray, Mechanism, Model, ReducedModel

if TYPE_CHECKING:
    from paramreduce_cli.expressions.live import LiveCount

_NEAR = 1.02
"""Estimates further apart than that are not the wrong way round."""


@dataclass
class _Variants:
    """The programs of one model in all formulations."""

    programs: list[Program]

    @cached_property
    def _counts(self) -> list[LiveCount]:
        """Return one estimator of operations per formulation."""
        from paramreduce_cli.expressions.live import LiveCount  # Numba is slow to load

        return [LiveCount(program) for program in self.programs]

    def estimate_operations(self, zero: BoolArray) -> list[int]:
        """Return about how many operations each formulation takes with some parameters zero."""
        return [count(zero) for count in self._counts]

    def select_promising(self, zero: BoolArray) -> list[int]:
        """Return the indices of the formulations that may turn out to be the leanest."""
        estimates = self.estimate_operations(zero)
        most = _NEAR * min(estimates)
        return [k for k, count in enumerate(estimates) if count <= most]


def get_lean_models(model: Model, *, independent: bool = False) -> LeanModels:
    """Return the lean models of a robot; those of the last robots are kept.

    The lean models of the last robots stay in memory: building all formulations of a six-joint arm takes half a second.

    Args:
        model: Model of the robot, with formulations to choose from.
        independent: See :class:`LeanModels`.
    """
    return _make_lean_models(_SameModel(model), independent)


@dataclass(frozen=True, eq=False)
class _SameModel:
    """A model that equals itself alone, as arrays cannot be hashed."""

    model: Model

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _SameModel) and other.model is self.model

    def __hash__(self) -> int:
        return id(self.model)


@lru_cache(2)
def _make_lean_models(same: _SameModel, independent: bool) -> LeanModels:
    return LeanModels(same.model, independent=independent)


class LeanModels:
    """Programs of the inverse and direct dynamics for any set of parameters.

    Inputs are the standard parameters, then q, dq and ddq. With ``independent`` and loops, the rows of R for the
    dependent coordinates follow one after the other, then the entries of b for these coordinates.

    Args:
        model: Model of the robot, with formulations to choose from.
        independent: Whether d_z and [M_zz | delta_z] are meant, with R and b handed in, instead of
            d_q and [M_qq | delta_q]; on an open tree they are the same.
    """

    def __init__(self, model: Model, *, independent: bool = False) -> None:
        mechanism = model.mechanism
        self._model, self.mechanism = model, mechanism
        self._useless = frozenset(np.flatnonzero(~model.affecting).tolist())
        self._tree = choose_frames(mechanism)
        self._projected = independent and mechanism.loops is not None
        self.n_parameters = mechanism.n_parameters

    def __reduce__(self) -> tuple[Callable[..., LeanModels], tuple[Model]]:
        # Other processes work out again what they need: that takes less than being told.
        return partial(LeanModels, independent=self._projected), (self._model,)

    @cached_property
    def _inverse(self) -> _Variants:
        return self._build_variants(
            build_inverse_outputs, self.get_formulations(), project_inverse_outputs
        )

    @cached_property
    def _direct(self) -> _Variants:
        return self._build_variants(
            build_direct_outputs, self.get_formulations(direct=True), project_direct_outputs
        )

    def _build_variants(
        self,
        build: Build,
        formulations: tuple[Formulation, ...],
        project: Callable[[Mechanism, Graph, Sequence[int]], list[int]],
    ) -> _Variants:
        """Return one program per formulation, with parameters that no reduced model keeps set to zero."""
        programs = []
        for formulation in formulations:
            graph = Graph()
            at_joints = [from_data(data) for data in formulation]
            outputs = build(self._tree, at_joints, graph, self._useless)
            if self._projected:
                outputs = project(self.mechanism, graph, outputs)
            programs.append(Program.from_graph(*Values(graph, outputs).simplify()))
            forget()  # what is remembered is of this graph, and large
        return _Variants(programs)

    def build_inverse(
        self, model: ReducedModel, *, constant: bool = False, rewritten: bool = True
    ) -> Program:
        """Return the inverse dynamics of a model; its outputs are the torques, (n_q,) or (n_dof,).

        Args:
            model: Model that says which parameters are kept, and which have one value.
            constant: Whether their values are known, and so part of the program.
            rewritten: Whether it is rewritten as far as that saves operations.
        """
        return self._build_leanest(self._inverse, model, constant, rewritten)

    def build_direct(
        self, model: ReducedModel, *, constant: bool = False, rewritten: bool = True
    ) -> Program:
        """Return [M | delta] of a model: the lower triangle of M, row by row, then delta.

        Args:
            model: Model that says which parameters are kept, and which have one value.
            constant: Whether their values are known, and so part of the program.
            rewritten: Whether it is rewritten as far as that saves operations.
        """
        return self._build_leanest(self._direct, model, constant, rewritten)

    def build_part(
        self,
        model: ReducedModel,
        *,
        direct: bool,
        outputs: slice,
        zero: Collection[int] = (),
        constant: bool = False,
    ) -> Program:
        """Return some outputs of the inverse or direct dynamics of a model, with some inputs zero, rewritten.

        Args:
            model: Model that says which parameters are kept, and which have one value.
            direct: Whether the outputs are those of the direct dynamics, not of the inverse.
            outputs: Outputs that are kept.
            zero: Positions of the inputs that are zero, such as those of accelerations.
            constant: Whether the values of the parameters are part of the program.
        """
        variants = self._direct if direct else self._inverse
        candidates = []
        for program in variants.programs:
            part = replace(program, outputs=program.outputs[outputs])
            candidates.append(self._specialise_program(part, model, constant, frozenset(zero)))
        return Program.from_graph(*minimise_operations(candidates))

    def choose_formulation(self, model: ReducedModel, *, direct: bool = False) -> Formulation:
        """Return the formulation that takes the fewest operations for a model, before rewriting."""
        variants = self._direct if direct else self._inverse
        _, number = self._choose_simplified(variants, model, constant=False)
        return self.get_formulations(direct=direct)[number]

    def get_formulations(self, *, direct: bool = False) -> tuple[Formulation, ...]:
        """Return all formulations of the inverse or of the direct dynamics."""
        known = self._model.formulations
        return known.direct if direct else known.inverse

    def restrict_to(self, formulation: Formulation, *, direct: bool = False) -> LeanModels:
        """Return lean models with a single formulation of the inverse or of the direct dynamics."""
        known = self._model.formulations
        if direct:
            found = replace(known, direct=(formulation,))
        else:
            found = replace(known, inverse=(formulation,))
        return LeanModels(replace(self._model, formulations=found), independent=self._projected)

    def estimate_operations(self, kept: IntArray, *, direct: bool = False) -> int:
        """Return about how many operations the leanest formulation takes, quickly enough to compare thousands of
        subsets.

        Args:
            kept: Indices of the parameters that are not zero.
            direct: Whether the direct dynamics are counted, not the inverse.
        """
        variants = self._direct if direct else self._inverse
        return min(variants.estimate_operations(self._mark_dropped(kept)))

    def _mark_dropped(self, kept: IntArray) -> BoolArray:
        """Return a mask of the parameters that are not kept, (n_parameters,)."""
        zero = np.ones(self.n_parameters, dtype=np.bool_)
        zero[kept] = False
        return zero

    def _build_leanest(
        self, variants: _Variants, model: ReducedModel, constant: bool, rewritten: bool
    ) -> Program:
        """Return the program with the fewest operations among the variants, one of each formulation, specialised to a
        model.

        Args:
            variants: Programs of all formulations, for any model.
            model: Model that says which parameters are kept, and which have one value.
            constant: Whether values of parameters are constants of the program, not inputs.
            rewritten: Whether programs are rewritten to save operations before they are compared.
        """
        if not rewritten:
            return Program.from_graph(*self._choose_simplified(variants, model, constant)[0])
        return Program.from_graph(
            *minimise_operations(self._specialise_promising(variants, model, constant).values())
        )

    def _choose_simplified(
        self, variants: _Variants, model: ReducedModel, constant: bool
    ) -> tuple[Values, int]:
        """Return the values of the leanest formulation before rewriting, and the index of the formulation."""
        specialised = self._specialise_promising(variants, model, constant)
        settled = [(values.simplify(), number) for number, values in specialised.items()]
        return min(settled, key=lambda entry: entry[0].n_operations)

    def _specialise_promising(
        self, variants: _Variants, model: ReducedModel, constant: bool
    ) -> dict[int, Values]:
        """Return the values of each formulation that may turn out to be the leanest for a model, by the formulation's
        index.
        """
        numbers = variants.select_promising(self._mark_dropped(model.kept))
        return {k: self._specialise_program(variants.programs[k], model, constant) for k in numbers}

    def _specialise_program(
        self,
        program: Program,
        model: ReducedModel,
        constant: bool,
        zero: frozenset[int] = frozenset(),
    ) -> Values:
        """Return the values of a program in which the parameters that a model drops, and some other inputs, are zero.

        Tied parameters are one input, or with ``constant`` all kept ones are numbers.
        """
        ties, values = model.ties, model.standard
        kept = frozenset(model.kept.tolist())
        graph = Graph()

        def substitute(position: int) -> int:
            """Return what takes the place of an input: zero, a number, or an input."""
            if position in zero:
                return ZERO
            if position >= self.n_parameters:
                return graph.input(position)
            if position not in kept:
                return ZERO
            if constant:
                return graph.constant(float(values[position]))
            return graph.input(ties.get(position, position))

        return Values(graph, program.rebuild(graph, substitute))
