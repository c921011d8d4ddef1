"""Lean position, velocity and acceleration problems of closed loops.

Newton's correction solves Phi_d x = -Phi. R and b of dq = R dz and ddq = R ddz + b solve Phi_d R_d = -Phi_z and
Phi_d b_d = gamma, as in :mod:`paramreduce_cli.multibody.loops.projection`. All of them eliminate Phi_d in the same order of
pivots, which is good on random states; results with smaller pivots than there are not to be trusted.
"""

from collections.abc import Iterable, Sequence
from functools import cached_property

import casadi as ca
import numpy as np

from paramreduce_cli.expressions.factoring import Values, minimise_operations
from paramreduce_cli.expressions.functions import Argument, Function
from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.expressions.programs import Program
from paramreduce_cli.lean.algebra import Scalar
from paramreduce_cli.lean.elimination import Elimination, Pivot, choose_pivots
from paramreduce_cli.multibody.loops.closures import express_equations
from paramreduce_cli.multibody.random_states import draw_states
from paramreduce_cli.records import FloatArray, Mechanism

_SAMPLES = 300
"""Random states on which the order of pivots is chosen."""
_SMALLEST = 1e-6
"""Pivot below which none is trusted."""
_SMALLER = 0.1
"""Share of the smallest pivot on the samples from which on a pivot is trusted."""


class LoopKinematics:
    """The functions of closed loops that a controller evaluates, with as few operations as are found.

    Args:
        mechanism: Mechanism with assembled loops.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self._mechanism = mechanism
        self._d, self._z = list(mechanism.dependent), list(mechanism.independent)
        n_q, n_d, n_z = mechanism.n_q, len(self._d), len(self._z)
        q, dq = ca.SX.sym("q", n_q), ca.SX.sym("dq", n_q)
        equations = express_equations(mechanism, q)
        jacobian = ca.jacobian(equations, q)
        gamma = -ca.jtimes(ca.jtimes(equations, q, dq), q, dq)
        self._jacobian = ca.Function("jacobian", [q], [ca.densify(jacobian)])
        self._programs = {
            "equations": _translate([q], equations),
            "jacobian": _translate([q], jacobian.T),  # row by row
            "gamma": _translate([q, dq], gamma),
        }
        self._q = Argument("q", (n_q,), "coordinates that close the loops, rad or m")
        self._dq = Argument("dq", (n_q,), "velocities of all coordinates, rad or m per s")
        self._ddq = Argument("ddq", (n_q,), "accelerations of all coordinates, rad or m per s^2")
        self._dz = Argument("dz", (n_z,), "velocities of the independent coordinates")
        self._ddz = Argument("ddz", (n_z,), "accelerations of the independent coordinates")
        self._R = Argument(
            "R", (n_d, n_z), "derivatives of the dependent by the independent coordinates"
        )
        self._b = Argument("b", (n_d,), "accelerations of the dependent coordinates at ddz = 0")
        self._step = Argument("step", (n_d,), "Newton's correction of the dependent coordinates")
        self._pivots = Argument("pivots", (n_d,), "pivots of the elimination")

    @cached_property
    def _blocks(self) -> list[list[Pivot]]:
        """Pivots of each block of Phi_d."""
        q, _, _ = draw_states(self._mechanism, _SAMPLES, np.random.default_rng(0))
        jacobians = self._jacobian.map(q.shape[0])(q.T).full()
        samples = jacobians.reshape(len(self._d), q.shape[0], -1).transpose(1, 0, 2)
        graph = Graph()
        rows = self._read_jacobian(
            graph, [Scalar(graph, graph.input(k)) for k in range(self._q.size)]
        )
        pattern = np.array([[bool(row[k]) for k in self._d] for row in rows])
        return choose_pivots(pattern, samples[:, :, self._d])

    @property
    def least_pivots(self) -> FloatArray:
        """Magnitudes below which the pivots are not trusted, in their order, (n_d,)."""
        least = np.array([pivot.least for block in self._blocks for pivot in block])
        return np.maximum(_SMALLER * least, _SMALLEST)

    def make_problems(self) -> tuple[Function, ...]:
        """Return the functions of the position, velocity and acceleration problems."""
        makers = (self.make_newton, self.make_velocities, self.make_accelerations, self.make_rates)
        return tuple(make() for make in makers)

    def make_newton(self) -> Function:
        """Return the function that gives Newton's correction of the position problem."""
        graph, (q,) = self._make_inputs(self._q)
        _, _, elimination = self._eliminate(graph, q)
        gap = self._evaluate("equations", graph, q)
        step = [-x for x in elimination.solve(gap)]
        text = "Newton's correction of the dependent coordinates."
        return _make_function(
            "newton", text, [self._q], [self._step, self._pivots], step, elimination.pivots
        )

    def make_velocities(self) -> Function:
        """Return the function that gives R and all velocities."""
        graph, (q, dz) = self._make_inputs(self._q, self._dz)
        tangent, elimination = self._solve_tangent(graph, q)
        rates = self._interleave(_multiply(tangent, dz), dz)
        return _make_function(
            "velocity_problem", "Velocities of all coordinates.", [self._q, self._dz],
            [self._R, self._dq, self._pivots], [x for row in tangent for x in row], rates, elimination.pivots,
        )  # fmt: skip

    def make_accelerations(self) -> Function:
        """Return the function that gives b and all accelerations for a known R."""
        arguments = [self._q, self._dq, self._R, self._ddz]
        graph, (q, dq, flat, ddz) = self._make_inputs(*arguments)
        _, _, elimination = self._eliminate(graph, q)
        drift = elimination.solve(self._evaluate("gamma", graph, [*q, *dq]))
        n_z = len(self._z)
        tangent = [flat[k : k + n_z] for k in range(0, len(flat), n_z)]
        rates = self._interleave(_add(_multiply(tangent, ddz), drift), ddz)
        return _make_function(
            "acceleration_problem", "Accelerations of all coordinates.", arguments,
            [self._b, self._ddq, self._pivots], drift, rates, elimination.pivots,
        )  # fmt: skip

    def make_rates(self) -> Function:
        """Return the function that gives R, b, all velocities and all accelerations at once."""
        arguments = [self._q, self._dz, self._ddz]
        graph, (q, dz, ddz) = self._make_inputs(*arguments)
        tangent, elimination = self._solve_tangent(graph, q)
        dq = self._interleave(_multiply(tangent, dz), dz)
        drift = elimination.solve(self._evaluate("gamma", graph, [*q, *dq]))
        ddq = self._interleave(_add(_multiply(tangent, ddz), drift), ddz)
        return _make_function(
            "rate_problem", "Velocities and accelerations of all coordinates.", arguments,
            [self._R, self._b, self._dq, self._ddq, self._pivots],
            [x for row in tangent for x in row], drift, dq, ddq, elimination.pivots,
        )  # fmt: skip

    def _make_inputs(self, *arguments: Argument) -> tuple[Graph, list[list[Scalar]]]:
        """Return a new graph, and the elements of the arguments as its inputs."""
        graph, start, elements = Graph(), 0, []
        for argument in arguments:
            elements.append([Scalar(graph, graph.input(start + k)) for k in range(argument.size)])
            start += argument.size
        return graph, elements

    def _solve_tangent(
        self, graph: Graph, q: Sequence[Scalar]
    ) -> tuple[list[list[Scalar]], Elimination]:
        """Return R of the dependent coordinates, (n_d, n_z), and the elimination of Phi_d."""
        _, by_independent, elimination = self._eliminate(graph, q)
        columns = [
            elimination.solve([-x for x in column]) for column in zip(*by_independent, strict=True)
        ]
        return [list(row) for row in zip(*columns, strict=True)], elimination

    def _eliminate(
        self, graph: Graph, q: Sequence[Scalar]
    ) -> tuple[list[list[Scalar]], list[list[Scalar]], Elimination]:
        """Return Phi_d, Phi_z and the elimination of Phi_d."""
        rows = self._read_jacobian(graph, q)
        by_dependent, by_independent = (
            [[row[k] for k in some] for row in rows] for some in (self._d, self._z)
        )
        return by_dependent, by_independent, Elimination(by_dependent, self._blocks)

    def _read_jacobian(self, graph: Graph, q: Sequence[Scalar]) -> list[list[Scalar]]:
        """Return the derivatives of the equations by all coordinates, (n_d, n_q)."""
        flat, n_q = self._evaluate("jacobian", graph, q), self._q.size
        return [flat[k : k + n_q] for k in range(0, len(flat), n_q)]

    def _evaluate(self, name: str, graph: Graph, inputs: Sequence[Scalar]) -> list[Scalar]:
        """Return the outputs of a program of the loops in a graph."""
        values = self._programs[name].rebuild(graph, lambda position: inputs[position].value)
        return [Scalar(graph, value) for value in values]

    def _interleave(
        self, dependent: Iterable[Scalar], independent: Iterable[Scalar]
    ) -> list[Scalar]:
        """Return dependent and independent elements in the order of the generalised coordinates."""
        elements = dict(zip(self._d, dependent, strict=True)) | dict(
            zip(self._z, independent, strict=True)
        )
        return [elements[k] for k in range(self._q.size)]


def _translate(inputs: list[ca.SX], outputs: ca.SX) -> Program:
    """Return expressions as a program, dense and column by column."""
    return Program.from_function(ca.Function("f", inputs, [ca.densify(ca.vec(outputs))]))


def _multiply(rows: Sequence[Sequence[Scalar]], vector: Sequence[Scalar]) -> list[Scalar]:
    """Return the product of a matrix and a vector."""
    products = ([x * y for x, y in zip(row, vector, strict=True)] for row in rows)
    return [sum(some[1:], start=some[0]) for some in products]


def _add(a: Sequence[Scalar], b: Sequence[Scalar]) -> list[Scalar]:
    """Return the sum of two vectors."""
    return [x + y for x, y in zip(a, b, strict=True)]


def _make_function(
    name: str,
    text: str,
    arguments: Sequence[Argument],
    results: Sequence[Argument],
    *values: Sequence[Scalar],
) -> Function:
    """Return a function of results whose elements are given, after rewriting with fewer operations."""
    flat = [x for some in values for x in some]
    graph, outputs = minimise_operations([Values(flat[0].graph, [x.value for x in flat])])
    return Function(
        name, text, tuple(arguments), tuple(results), Program.from_graph(graph, outputs)
    )
