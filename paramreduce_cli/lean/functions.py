"""The functions that a model consists of, for a set of parameters, ready for export."""

from collections.abc import Callable

import casadi as ca

from paramreduce_cli.expressions.factoring import least
from paramreduce_cli.expressions.functions import Argument, Function
from paramreduce_cli.expressions.graph import ZERO, Graph
from paramreduce_cli.expressions.operations import Program
from paramreduce_cli.lean.model import LeanModels
from paramreduce_cli.multibody.loops.closures import closure_equations
from paramreduce_cli.records import Model, ReducedModel


class LeanFunctions:
    """Functions of a reduced model.

    Args:
        model: Of the robot.
        reduced: Which parameters are kept, and their values.
        constant: Whether the values are part of the functions.
    """

    def __init__(self, model: Model, reduced: ReducedModel, *, constant: bool = False) -> None:
        mechanism = model.mechanism
        self._mechanism = mechanism
        self._models = LeanModels(mechanism, model.formulations, independent=True)
        self._reduced = reduced.restricted(model.affecting)
        self._constant = constant
        loops = mechanism.loops is not None
        q, z = mechanism.n_q, mechanism.n_dof
        d = q - z
        self._phi = Argument("phi", (reduced.n,), "parameters")
        unit = "rad or m"
        self._states = (
            Argument("q", (q,), f"coordinates, {unit}"),
            Argument("dq", (q,), f"their velocities, {unit} per s"),
            Argument("ddq", (q,), f"their accelerations, {unit} per s^2"),
        )
        self._R = Argument(
            "R", (d, z), "derivatives of the dependent by the independent coordinates"
        )
        self._b = Argument("b", (d,), "accelerations of the dependent coordinates at ddz = 0")
        self._loops = (self._R, self._b) if loops else ()

    def inverse(self) -> Function:
        """Torques of a motion."""
        z = self._mechanism.n_dof
        tau = Argument("tau", (z,), "torques or forces, N m or N")
        text = "Torques of the independent coordinates for a motion."
        return self._function(
            "inverse_dynamics", text, self._models.inverse, (tau,), lambda outputs: outputs
        )

    def direct(self) -> Function:
        """Mass matrix and bias."""
        z = self._mechanism.n_dof
        M = Argument("M", (z, z), "mass matrix")
        delta = Argument("delta", (z,), "torques without acceleration, N m or N")

        def whole(outputs: list[int]) -> list[int]:
            lower, bias = outputs[:-z], outputs[-z:]
            rows = range(z)
            full = [lower[max(i, j) * (max(i, j) + 1) // 2 + min(i, j)] for i in rows for j in rows]
            return full + bias

        text = "Mass matrix and bias: tau = M ddz + delta."
        return self._function("direct_dynamics", text, self._models.direct, (M, delta), whole)

    def regressor(self) -> Function:
        """Torques as a linear map of the parameters."""
        n, z = self._reduced.n, self._mechanism.n_dof
        start, place = self._models.n_parameters, self._reduced.position
        program = self._models.inverse(self._reduced)
        graph = Graph()
        columns = []
        for value in range(n):

            def substitute(position: int, value: int = value) -> int:
                if position >= start:
                    return graph.input(position - start)
                return graph.constant(1.0) if place[position] == value else ZERO

            columns.append(program.rebuilt(graph, substitute))
        outputs = [columns[j][i] for i in range(z) for j in range(n)]
        graph, outputs = least(graph, outputs)
        K = Argument("K", (z, n), "torques for unit values of the parameters")
        function = Function(
            "regressor",
            "Torques as a linear map of the parameters: tau = K phi.",
            (*self._states, *self._loops),
            (K,),
            Program.of_graph(graph, outputs),
        )
        return self._trimmed(function)

    def _function(
        self,
        name: str,
        text: str,
        model: Callable[..., Program],
        results: tuple[Argument, ...],
        arranged: Callable[[list[int]], list[int]],
    ) -> Function:
        program = model(self._reduced, constant=self._constant)
        start, n, place = self._models.n_parameters, self._reduced.n, self._reduced.position
        graph = Graph()

        def substitute(position: int) -> int:
            if position >= start:
                return graph.input(position - start + n)
            return graph.input(int(place[position]))

        outputs = arranged(program.rebuilt(graph, substitute))
        return self._trimmed(
            Function(
                name,
                text,
                (self._phi, *self._states, *self._loops),
                results,
                Program.of_graph(graph, outputs),
            )
        )

    def _trimmed(self, function: Function) -> Function:
        """Without arguments that its kind never needs; the others stay, used or not."""
        needed = {
            "inverse_dynamics": {"phi", "q", "dq", "ddq", "R"},
            "direct_dynamics": {"phi", "q", "dq", "R", "b"},
            "regressor": {"q", "dq", "ddq", "R"},
        }[function.name]
        if self._constant:
            needed = needed - {"phi"}
        for argument in function.arguments:
            if argument.name not in needed:
                function = function.without(argument.name)
        return function

    def closures(self) -> list[Function]:
        """What the position, velocity and acceleration problems of loops are made of."""
        mechanism = self._mechanism
        q, dq = ca.SX.sym("q", mechanism.n_q), ca.SX.sym("dq", mechanism.n_q)
        equations = closure_equations(mechanism, q)
        jacobian = ca.jacobian(equations, q)
        gamma = -ca.jtimes(ca.jtimes(equations, q, dq), q, dq)
        d, z = list(mechanism.dependent), list(mechanism.independent)
        n_d = len(d)
        gap = Argument("Phi", (n_d,), "how far the loops are from being closed")
        J_d = Argument("Phi_d", (n_d, n_d), "its derivatives by the dependent coordinates")
        J_z = Argument("Phi_z", (n_d, len(z)), "its derivatives by the independent coordinates")
        right = Argument("gamma", (n_d,), "what is left of its second derivative, negative")
        by_d, by_z = (ca.vec(ca.densify(jacobian[:, some]).T) for some in (d, z))
        states = self._states[:1], self._states[:2]
        return [
            _of_casadi("closure", "The equations that close the loops.", [q], states[0],
                       [equations, by_d], (gap, J_d)),
            _of_casadi("closure_jacobian", "Derivatives of the equations.", [q], states[0],
                       [by_d, by_z], (J_d, J_z)),
            _of_casadi("closure_bias", "Right side of the acceleration problem.", [q, dq],
                       states[1], [gamma], (right,)),
        ]  # fmt: skip


def _of_casadi(
    name: str,
    text: str,
    inputs: list[ca.SX],
    arguments: tuple[Argument, ...],
    outputs: list[ca.SX],
    results: tuple[Argument, ...],
) -> Function:
    function = ca.Function(name, inputs, [ca.densify(ca.vertcat(*outputs))])
    graph = Graph()
    values = Program.of_function(function).rebuilt(graph)
    graph, values = least(graph, values)
    return Function(name, text, arguments, results, Program.of_graph(graph, values))
