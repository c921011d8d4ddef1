"""Parts of the dynamics, and functions derived from them, ready for export."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from paramreduce_cli.errors import DataError
from paramreduce_cli.expressions.derivatives import differentiate, find_gradient
from paramreduce_cli.expressions.factoring import Values, minimise_operations
from paramreduce_cli.expressions.functions import Argument, Function
from paramreduce_cli.expressions.graph import ZERO, Graph
from paramreduce_cli.expressions.programs import Program
from paramreduce_cli.lean.lean_functions import LeanFunctions, fill_symmetric
from paramreduce_cli.lean.lean_models import LeanModels
from paramreduce_cli.records import INERTIAL, BoolArray, Kind, Mechanism, ReducedModel


class DynamicsParts(LeanFunctions):
    """Functions of a reduced model that give a part of its dynamics, or derivatives, ready for export."""

    def make_gravity(self) -> Function:
        """Return the function that gives the torques at rest."""
        g = Argument("g", (self._mechanism.n_dof,), "torques at rest, N m or N")
        text = (
            "Torques of the independent coordinates at rest: gravity, springs and constant torques."
        )
        still = {*self._list_inputs("dq"), *self._list_inputs("ddq")}
        return self._make_part("gravity", text, g, self._models, self._reduced, still)

    def make_nonlinear(self) -> Function:
        """Return the function that gives the torques without acceleration."""
        delta = Argument(
            "delta", (self._mechanism.n_dof,), "torques without acceleration, N m or N"
        )
        text = "Torques without acceleration, gravity and friction included: tau = M ddz + delta."
        return self._make_part(
            "nonlinear_effects", text, delta, self._models, self._reduced, set(), direct=True
        )

    def make_coriolis(self) -> Function:
        """Return the function that gives Coriolis and centrifugal torques."""
        c = Argument("c", (self._mechanism.n_dof,), "Coriolis and centrifugal torques, N m or N")
        text = "Coriolis and centrifugal torques C dz, without gravity, springs and friction."
        models = self._make_weightless()
        inertial = self._reduced.drop_unaffecting(find_inertial_parameters(self._mechanism))
        return self._make_part("coriolis", text, c, models, inertial, set(), direct=True)

    def _make_weightless(self) -> LeanModels:
        """Return lean models without gravity."""
        mechanism = replace(self._mechanism, gravity=np.zeros(3))
        return LeanModels(replace(self._model, mechanism=mechanism), independent=True)

    def make_mass_matrix(self) -> Function:
        """Return the function that gives the mass matrix."""
        z = self._mechanism.n_dof
        M = Argument("M", (z, z), "mass matrix")
        return self._make_part(
            "mass_matrix", "Mass matrix.", M, self._models, self._reduced, set(), direct=True
        )

    def make_coriolis_matrix(self) -> Function:
        """Return the function that gives C in Christoffel form: c is quadratic in the velocities, so that C is half of its
        derivative by them, and dM/dt - 2 C is skew.

        Raises:
            DataError: The mechanism has closed loops.
        """
        self._require_tree("the Coriolis matrix")
        z = self._mechanism.n_dof
        C = Argument("C", (z, z), "matrix of Coriolis and centrifugal torques C dq")
        text = "Coriolis matrix in Christoffel form, so that dM/dt - 2 C is skew."
        c = self.make_coriolis()
        graph, outputs = c.program.to_graph()
        speeds = self._list_positions(c, "dq")
        half = graph.constant(0.5)
        rows = _differentiate_forward(graph, outputs, speeds)
        entries = [graph.multiply(half, entry) for row in rows for entry in row]
        program = Program.from_graph(*minimise_operations([Values(graph, entries)]))
        return Function("coriolis_matrix", text, c.arguments, (C,), program)

    def make_derivatives(self) -> Function:
        """Return the function that gives the derivatives of the torques by coordinates and velocities.

        Raises:
            DataError: The mechanism has closed loops.
        """
        self._require_tree("the derivative of the torques")
        z = self._mechanism.n_dof
        by_q = Argument("tau_by_q", (z, z), "derivatives of the torques by the coordinates")
        by_dq = Argument("tau_by_dq", (z, z), "derivatives of the torques by the velocities")
        text = "Derivatives of the inverse dynamics; those by the accelerations are the mass matrix. At a jump of friction they are those beside it."
        inverse = self.make_inverse()
        sides = [self._list_positions(inverse, name) for name in ("q", "dq")]
        candidates = []
        for find_jacobian in (_differentiate_forward, _differentiate_backward):
            graph, outputs = inverse.program.to_graph()
            rows = [row for inputs in sides for row in find_jacobian(graph, outputs, inputs)]
            values = Values(graph, [entry for row in rows for entry in row])
            candidates.append(Program.from_graph(*minimise_operations([values])))
        program = min(candidates, key=lambda candidate: candidate.n_operations)
        name = "inverse_dynamics_derivatives"
        return Function(name, text, inverse.arguments, (by_q, by_dq), program)

    def make_momentum(self) -> Function:
        """Return the function that gives the momentum and its rate without torques.

        With p = M dq and the kinetic energy T, the rate is dT/dq less gravity, springs and friction.

        Raises:
            DataError: The mechanism has closed loops.
        """
        self._require_tree("the momentum")
        z, models = self._mechanism.n_dof, self._models
        p = Argument("p", (z,), "momentum M dq, N m s or N s")
        beta = Argument("beta", (z,), "rate of the momentum without torques, N m or N")
        text = "Momentum p, and beta with dp/dt = tau + beta under torques tau."
        dq, ddq = self._list_inputs("dq"), self._list_inputs("ddq")
        is_inertial = find_inertial_parameters(self._mechanism)
        inertial = self._reduced.drop_unaffecting(is_inertial)
        drives = self._reduced.drop_unaffecting(~is_inertial)
        graph, every = Graph(), slice(None)

        def add(
            models: LeanModels,
            reduced: ReducedModel,
            zero: Collection[int],
            moved: Mapping[int, int],
        ) -> list[int]:
            """Add the torques of some parameters to the graph, with some inputs zero and others taken for each other."""
            program = models.build_part(
                reduced, direct=False, outputs=every, zero=set(zero), constant=self._constant
            )
            return self._insert(graph, program, moved)

        # Without velocities and gravity, accelerations dq take the torques M dq.
        momentum = add(self._make_weightless(), inertial, dq, dict(zip(ddq, dq, strict=True)))
        gravity = add(models, inertial, {*dq, *ddq}, {})
        losses = add(models, drives, ddq, {})
        n_phi = self._reduced.n
        n = self._mechanism.n_q
        energy = ZERO
        for k, value in enumerate(momentum):
            energy = graph.add(energy, graph.multiply(value, graph.input(n_phi + n + k)))
        gradient = find_gradient(graph, graph.multiply(graph.constant(0.5), energy))
        rates = []
        for k in range(z):
            others = graph.add(gravity[k], losses[k])
            rates.append(graph.subtract(gradient.get(n_phi + k, ZERO), others))
        graph, outputs = minimise_operations([Values(graph, [*momentum, *rates])])
        return self._make_function("momentum", text, (p, beta), graph, outputs)

    def make_forward_dynamics(self) -> Function:
        """Return the function that gives the accelerations of the independent coordinates under given torques."""
        direct = self.make_direct()
        z = direct.results[1].size
        name = "ddz" if any(argument.name == "R" for argument in direct.arguments) else "ddq"
        result = Argument(name, (z,), "accelerations of the independent coordinates")
        tau = Argument("tau", (z,), "torques or forces, N m or N")
        text = "Accelerations under given torques, by a factorisation L D L' of the mass matrix."
        graph, outputs = direct.program.to_graph()
        first = sum(argument.size for argument in direct.arguments)
        M = [outputs[i * z : (i + 1) * z] for i in range(z)]
        left = [graph.subtract(graph.input(first + i), outputs[z * z + i]) for i in range(z)]
        program = Program.from_graph(
            *minimise_operations([Values(graph, solve_symmetric(graph, M, left))])
        )
        return Function("forward_dynamics", text, (*direct.arguments, tau), (result,), program)

    def _require_tree(self, what: str) -> None:
        """Raise DataError if the mechanism has loops."""
        if self._mechanism.loops is not None:
            raise DataError(
                f"{what} needs an open tree: with closed loops R and b are arguments, which depend on the coordinates."
            )

    @staticmethod
    def _list_positions(function: Function, name: str) -> list[int]:
        """Return the positions of an argument among the inputs of a function."""
        positions = function.list_positions(function.arguments)
        return [k for k, (argument, _) in enumerate(positions) if argument.name == name]

    def _make_part(
        self,
        name: str,
        text: str,
        result: Argument,
        models: LeanModels,
        reduced: ReducedModel,
        zero: Collection[int],
        *,
        direct: bool = False,
    ) -> Function:
        """Return a function of a part of the dynamics.

        Args:
            name: Name of the function.
            text: Sentence on what the function computes.
            result: Result; a mass matrix is the lower triangle of the direct dynamics, anything else its bias.
            models: Lean models that the part is taken from.
            reduced: Parameters that are kept.
            zero: Positions of the inputs that are zero.
            direct: Whether the part is taken from the direct dynamics, not from the inverse.
        """
        z = self._mechanism.n_dof
        square = len(result.shape) == 2
        outputs_kept = slice(0, -z) if square else slice(-z, None)
        program = models.build_part(
            reduced, direct=direct, outputs=outputs_kept, zero=zero, constant=self._constant
        )
        if direct and not square and self._mechanism.loops is None:
            # Without loops the bias is also the inverse dynamics without accelerations.
            other = models.build_part(
                reduced, direct=False, outputs=outputs_kept, zero=self._list_inputs("ddq"), constant=self._constant
            )  # fmt: skip
            program = min(program, other, key=lambda one: one.n_operations)
        graph, outputs = self._renumber(program)
        if square:
            outputs = fill_symmetric(outputs, z)
        return self._make_function(name, text, (result,), graph, outputs)

    def _list_inputs(self, name: str) -> range:
        """Return the positions of the velocities dq or accelerations ddq among the inputs of lean models."""
        n, start = self._mechanism.n_q, self._models.n_parameters
        place = ("q", "dq", "ddq").index(name)
        return range(start + place * n, start + (place + 1) * n)


def _differentiate_forward(
    graph: Graph, outputs: Sequence[int], inputs: Sequence[int]
) -> list[list[int]]:
    """Return the rows of the Jacobian of outputs by inputs, column by column."""
    columns = [differentiate(graph, outputs, position) for position in inputs]
    return [list(row) for row in zip(*columns, strict=True)]


def _differentiate_backward(
    graph: Graph, outputs: Sequence[int], inputs: Sequence[int]
) -> list[list[int]]:
    """Return the rows of the Jacobian of outputs by inputs, row by row."""
    gradients = [find_gradient(graph, output) for output in outputs]
    return [[gradient.get(position, ZERO) for position in inputs] for gradient in gradients]


def find_inertial_parameters(mechanism: Mechanism) -> BoolArray:
    """Return which parameters are those of masses and rotors, and not of friction and springs, (n_parameters,)."""
    kinds = {*INERTIAL, Kind.ROTOR}
    return np.array([parameter.kind in kinds for parameter in mechanism.parameters], dtype=bool)


def solve_symmetric(graph: Graph, M: Sequence[Sequence[int]], right: Sequence[int]) -> list[int]:
    """Return the solution of M x = right for a positive definite matrix, by a factorisation L D L' without square roots.

    Args:
        graph: Graph of all values.
        M: References to the entries, (n, n), of which the lower triangle is read.
        right: References to the right side, (n,).
    """
    n = len(right)
    rows = [list(row) for row in M]
    inverses: list[int] = []
    factors = [[ZERO] * n for _ in range(n)]
    for k in range(n):
        inverses.append(graph.call("inv", rows[k][k]) if rows[k][k] != ZERO else ZERO)
        for i in range(k + 1, n):
            factors[i][k] = graph.multiply(rows[i][k], inverses[k])
        for i in range(k + 1, n):
            for j in range(k + 1, i + 1):
                product = graph.multiply(factors[i][k], rows[j][k])
                rows[i][j] = graph.subtract(rows[i][j], product)
    x = list(right)
    for i in range(n):
        for k in range(i):
            x[i] = graph.subtract(x[i], graph.multiply(factors[i][k], x[k]))
    x = [graph.multiply(value, inverse) for value, inverse in zip(x, inverses, strict=True)]
    for i in reversed(range(n)):
        for k in range(i + 1, n):
            x[i] = graph.subtract(x[i], graph.multiply(factors[k][i], x[k]))
    return x
