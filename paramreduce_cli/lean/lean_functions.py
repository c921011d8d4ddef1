"""The functions that a model consists of, for a set of parameters, ready for export."""

from collections.abc import Callable, Mapping, Sequence

import casadi as ca
import numpy as np

from paramreduce_cli.expressions.factoring import Values, minimise_operations
from paramreduce_cli.expressions.functions import Argument, Function
from paramreduce_cli.expressions.graph import ZERO, Graph
from paramreduce_cli.expressions.programs import Program
from paramreduce_cli.lean.lean_models import get_lean_models
from paramreduce_cli.lean.loop_projection import project_direct_outputs, project_inverse_outputs
from paramreduce_cli.multibody.loops.closures import express_equations
from paramreduce_cli.records import Model, ReducedModel, TermModel


class LeanFunctions:
    """Functions of a reduced model, ready for export.

    Args:
        model: Model of the robot.
        reduced: Parameters that are kept, and their values.
        constant: Whether the values are part of the functions.
        simplified: Function with pruned terms; ``reduced`` holds its parameters.
    """

    def __init__(
        self,
        model: Model,
        reduced: ReducedModel,
        *,
        constant: bool = False,
        simplified: TermModel | None = None,
    ) -> None:
        mechanism = model.mechanism
        self._model, self._simplified = model, simplified
        self._mechanism = mechanism
        self._models = get_lean_models(model, independent=True)
        self._reduced = reduced.drop_unaffecting(model.affecting)
        self._constant = constant
        q, z = mechanism.n_q, mechanism.n_dof
        self._states = (
            Argument("q", (q,), "coordinates, rad or m"),
            Argument("dq", (q,), "their velocities, rad or m per s"),
            Argument("ddq", (q,), "their accelerations, rad or m per s^2"),
        )
        self._arguments: tuple[Argument, ...] = (
            Argument("phi", (reduced.n,), "parameters"),
            *self._states,
        )
        if mechanism.loops is not None:
            R = "derivatives of the dependent by the independent coordinates"
            b = "accelerations of the dependent coordinates at ddz = 0"
            self._arguments += (Argument("R", (q - z, z), R), Argument("b", (q - z,), b))

    def make_inverse(self) -> Function:
        """Return the function that gives the torques of a motion."""
        tau = Argument("tau", (self._mechanism.n_dof,), "torques or forces, N m or N")
        text = "Torques of the independent coordinates for a motion."
        graph, outputs = self._build_lean_outputs(
            self._models.build_inverse, project_inverse_outputs
        )
        return self._make_function("inverse_dynamics", text, (tau,), graph, outputs)

    def make_direct(self) -> Function:
        """Return the function that gives the mass matrix and the bias."""
        z = self._mechanism.n_dof
        M = Argument("M", (z, z), "mass matrix")
        delta = Argument("delta", (z,), "torques without acceleration, N m or N")
        text = "Mass matrix and remainder, gravity and friction included: tau = M ddz + delta."
        graph, outputs = self._build_lean_outputs(self._models.build_direct, project_direct_outputs)
        full = fill_symmetric(outputs[:-z], z) + outputs[-z:]
        return self._make_function("direct_dynamics", text, (M, delta), graph, full)

    def make_regressor(self) -> Function:
        """Return the function that gives the regressor: torques are linear in the parameters."""
        n, z = self._reduced.n, self._mechanism.n_dof
        start, place = self._models.n_parameters, self._reduced.position
        program = self._models.build_inverse(self._reduced)
        graph = Graph()
        columns = []
        for value in range(n):

            def substitute(position: int, value: int = value) -> int:
                """Return 1 for the parameters of this column, 0 for others; other inputs follow the kept parameters."""
                if position >= start:
                    return graph.input(position - start + n)
                return graph.constant(1.0) if place[position] == value else ZERO

            columns.append(program.rebuild(graph, substitute))
        outputs = [columns[j][i] for i in range(z) for j in range(n)]
        K = Argument("K", (z, n), "torques for unit values of the parameters")
        text = "Torques as a linear map of the parameters: tau = K phi."
        return self._make_function(
            "regressor", text, (K,), *minimise_operations([Values(graph, outputs)])
        )

    def _build_lean_outputs(
        self, model: Callable[..., Program], project: Callable[..., list[int]]
    ) -> tuple[Graph, list[int]]:
        """Return the outputs of a lean model in a graph whose inputs are the kept parameters, then q, dq and ddq, and
        with loops R and b.
        """
        if self._simplified is not None:
            program = self._build_pruned_program(self._simplified, project)
        else:
            program = model(self._reduced, constant=self._constant)
        return self._renumber(program)

    def _renumber(self, program: Program) -> tuple[Graph, list[int]]:
        """Return the outputs of a program of lean models in a graph whose inputs are the kept parameters, then the others."""
        graph = Graph()
        return graph, self._insert(graph, program)

    def _insert(
        self, graph: Graph, program: Program, replaced: Mapping[int, int] | None = None
    ) -> list[int]:
        """Add a program of lean models to a graph whose inputs are the kept parameters, then the others, and return its
        outputs.

        Args:
            graph: Graph that the program is added to.
            program: Program with the inputs of lean models.
            replaced: Positions of inputs of lean models, by the positions of those that they are used for.
        """
        start, n, place = self._models.n_parameters, self._reduced.n, self._reduced.position

        def substitute(position: int) -> int:
            """Return the input of a kept parameter by its position in the model, or another input behind these."""
            position = (replaced or {}).get(position, position)
            kept = position - start + n if position >= start else int(place[position])
            return graph.input(kept)

        return program.rebuild(graph, substitute)

    def _build_pruned_program(
        self, simplified: TermModel, project: Callable[..., list[int]]
    ) -> Program:
        """Return a pruned program, for the independent coordinates, with the same order of inputs as lean models have."""
        start, n = self._models.n_parameters, simplified.values.size
        first = [int(np.flatnonzero(simplified.position == k)[0]) for k in range(n)]
        graph = Graph()

        def substitute(position: int) -> int:
            """Return the input of a lean model for an input of the pruned program."""
            if position >= n:
                return graph.input(position - n + start)
            if self._constant:
                return graph.constant(float(simplified.values[position]))
            return graph.input(first[position])

        outputs = Program.from_stored(simplified.program).rebuild(graph, substitute)
        to_project = self._mechanism.loops is not None and not simplified.projected
        if to_project:
            outputs = project(self._mechanism, graph, outputs)
        if to_project or self._constant:
            return Program.from_graph(*minimise_operations([Values(graph, outputs)]))
        return Program.from_graph(graph, outputs)

    def _make_function(
        self, name: str, text: str, results: tuple[Argument, ...], graph: Graph, outputs: list[int]
    ) -> Function:
        """Return a function without the arguments that functions of its kind never need."""
        needed = {
            "inverse_dynamics": {"phi", "q", "dq", "ddq", "R"},
            "direct_dynamics": {"phi", "q", "dq", "R", "b"},
            "nonlinear_effects": {"phi", "q", "dq", "R", "b"},
            "coriolis": {"phi", "q", "dq", "R", "b"},
            "mass_matrix": {"phi", "q", "R"},
            "momentum": {"phi", "q", "dq"},
            "gravity": {"phi", "q", "R"},
            "regressor": {"q", "dq", "ddq", "R"},
        }[name]
        if self._constant:
            needed = needed - {"phi"}
        program = Program.from_graph(graph, outputs)
        return Function(name, text, self._arguments, results, program).restrict_arguments(needed)

    def make_closures(self) -> list[Function]:
        """Return the functions that the position, velocity and acceleration problems of loops consist of."""
        mechanism = self._mechanism
        q, dq = ca.SX.sym("q", mechanism.n_q), ca.SX.sym("dq", mechanism.n_q)
        equations = express_equations(mechanism, q)
        jacobian = ca.jacobian(equations, q)
        gamma = -ca.jtimes(ca.jtimes(equations, q, dq), q, dq)
        d, z = list(mechanism.dependent), list(mechanism.independent)
        n_d = len(d)
        gap = Argument("Phi", (n_d,), "how far the loops are from being closed")
        J_d = Argument("Phi_d", (n_d, n_d), "its derivatives by the dependent coordinates")
        J_z = Argument("Phi_z", (n_d, len(z)), "its derivatives by the independent coordinates")
        right = Argument("gamma", (n_d,), "what is left of its second derivative, negative")
        by_d, by_z = (ca.vec(ca.densify(jacobian[:, some]).T) for some in (d, z))

        def make_function(
            name: str, text: str, inputs: list, outputs: list, *results: Argument
        ) -> Function:
            """Return a function of the loops with its expressions rewritten."""
            function = ca.Function(name, inputs, [ca.densify(ca.vertcat(*outputs))])
            graph = Graph()
            graph, values = minimise_operations(
                [Values(graph, Program.from_function(function).rebuild(graph))]
            )
            states = self._states[: len(inputs)]
            return Function(name, text, states, results, Program.from_graph(graph, values))

        return [
            make_function(
                "closure", "The equations that close the loops.", [q], [equations, by_d], gap, J_d
            ),
            make_function(
                "closure_jacobian", "Derivatives of the equations.", [q], [by_d, by_z], J_d, J_z
            ),
            make_function(
                "closure_bias", "Right side of the acceleration problem.", [q, dq], [gamma], right
            ),
        ]


def fill_symmetric(lower: Sequence[int], n: int) -> list[int]:
    """Return all entries of a symmetric matrix, row by row, from those of its lower triangle."""
    rows = range(n)
    return [lower[max(i, j) * (max(i, j) + 1) // 2 + min(i, j)] for i in rows for j in rows]
