"""Straight-line programs: counted, specialised and evaluated.

An operation is a sum, a product, or a call of a function (sin, cos, ...) that no other
operation repeats. Two rules are offered:

* ``signs_free``: sign changes are absorbed into the sum or product they meet, which is what
  compiled code does. This is the project's count.
* otherwise a sign change is an operation like any other, as where operator characters of
  generated text are counted [Ros2019].

Inputs can be declared zero (dropped parameters); what they annihilate is not counted.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import casadi as ca
import numpy as np

from paramreduce_cli.expressions.graph import ZERO, Graph, Node
from paramreduce_cli.records import NO_OPERAND, FloatArray, StoredProgram

_UNARY = {
    ca.OP_SIN: "sin",
    ca.OP_COS: "cos",
    ca.OP_SQRT: "sqrt",
    ca.OP_INV: "inv",
    ca.OP_ASIN: "asin",
    ca.OP_ACOS: "acos",
    ca.OP_ATAN: "atan",
    ca.OP_TAN: "tan",
    ca.OP_TANH: "tanh",
    ca.OP_SIGN: "sign",
    ca.OP_NEG: "neg",
}
_BINARY = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/", ca.OP_ATAN2: "atan2"}
_NOTHING: Mapping[int, int] = MappingProxyType({})

_EVALUATED = {
    "sin": np.sin,
    "cos": np.cos,
    "sqrt": np.sqrt,
    "inv": np.reciprocal,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "tan": np.tan,
    "tanh": np.tanh,
    "sign": np.sign,
    "neg": np.negative,
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "atan2": np.arctan2,
}


@dataclass(frozen=True)
class Program:
    """A function as a list of nodes, each made of those before it.

    Operands and outputs are signed references as in :mod:`paramreduce_cli.expressions.graph`, to
    positions in ``nodes``.
    """

    nodes: tuple[Node, ...]
    outputs: tuple[int, ...]

    @classmethod
    def from_function(cls, function: ca.Function) -> Program:
        """Return the program of a CasADi function of SX expressions, with its inputs numbered consecutively."""
        starts = np.cumsum([0, *(function.nnz_in(i) for i in range(function.n_in()))])
        nodes: list[Node] = []
        slots: dict[int, int] = {}
        outputs: list[int] = []
        for k in range(function.n_instructions()):
            op, arguments = function.instruction_id(k), function.instruction_input(k)
            if op == ca.OP_OUTPUT:
                outputs.append(slots[arguments[0]])
                continue
            if op == ca.OP_CONST:
                node = Node("constant", (), function.instruction_constant(k))
            elif op == ca.OP_INPUT:
                node = Node("input", (), int(starts[arguments[0]]) + arguments[1])
            else:
                node = _translate_operation(op, tuple(slots[a] for a in arguments))
            slots[function.instruction_output(k)[0]] = 2 * len(nodes)
            nodes.append(node)
        return cls(tuple(nodes), tuple(outputs))

    @classmethod
    def from_graph(cls, graph: Graph, outputs: Sequence[int]) -> Program:
        """Return the program that computes some values of a graph."""
        reached = graph.find_reached(list(outputs))
        place = {node: 2 * k for k, node in enumerate(reached)}

        def renumber(values: Sequence[int]) -> tuple[int, ...]:
            return tuple(place[value >> 1] ^ (value & 1) for value in values)

        nodes = tuple(
            Node(node.operation, renumber(node.operands), node.number)
            for node in (graph.nodes[k] for k in reached)
        )
        return cls(nodes, renumber(outputs))

    def to_graph(self) -> tuple[Graph, list[int]]:
        """Return a graph of the program with the same inputs, and its outputs."""
        graph = Graph()
        return graph, self.rebuild(graph, graph.input)

    @classmethod
    def from_stored(cls, stored: StoredProgram) -> Program:
        """Return the program in stored arrays."""
        nodes = tuple(
            Node(operation, tuple(pair[pair >= 0].tolist()), float(number))
            for operation, pair, number in zip(
                stored.operations, stored.operands, stored.numbers, strict=True
            )
        )
        return cls(nodes, tuple(stored.outputs.tolist()))

    def to_stored(self) -> StoredProgram:
        """Return the program as arrays."""
        padded = [[*node.operands, NO_OPERAND, NO_OPERAND][:2] for node in self.nodes]
        return StoredProgram(
            operations=tuple(node.operation for node in self.nodes),
            operands=np.array(padded, dtype=np.int64).reshape(-1, 2),
            numbers=np.array([node.number for node in self.nodes], dtype=float),
            outputs=np.array(self.outputs, dtype=np.int64),
        )

    @property
    def operations(self) -> set[str]:
        """Names of the operations it is made of."""
        return {node.operation for node in self.nodes}

    @property
    def n_operations(self) -> int:
        """Operations it takes as it stands."""
        return sum(node.operation not in ("constant", "input") for node in self.nodes)

    def rebuild(self, graph: Graph, substitute: Callable[[int], int] | None = None) -> list[int]:
        """Build the program again in another graph.

        Args:
            graph: Graph that the nodes are added to.
            substitute: Function that returns the reference, in that graph, that replaces an input, given its position;
                by default the input stays.

        Returns:
            References to the outputs.
        """
        substitute = substitute or graph.input
        values: list[int] = []
        for operation, operands, number in self.nodes:
            arguments = [
                graph.negate(values[a >> 1]) if a & 1 else values[a >> 1] for a in operands
            ]
            if operation == "*":
                value = graph.multiply(*arguments)
            elif operation == "+":
                value = _add_signed(
                    graph, [values[a >> 1] for a in operands], [a & 1 for a in operands]
                )
            elif operation == "input":
                value = substitute(int(number))
            elif operation == "constant":
                value = graph.constant(number)
            elif operation == "-":
                value = graph.subtract(*arguments)
            elif operation == "neg":
                value = graph.negate(arguments[0])
            else:
                value = graph.call(operation, *arguments)
            values.append(value)
        return [graph.negate(values[a >> 1]) if a & 1 else values[a >> 1] for a in self.outputs]

    def renumber(self, place: Callable[[int], int]) -> Program:
        """Return the program with its inputs at other positions.

        Args:
            place: New position of each input, by its present position; negative if the input is zero.
        """
        graph = Graph()

        def substitute(position: int) -> int:
            """Return the input at the new position, or zero."""
            moved = place(position)
            return graph.input(moved) if moved >= 0 else ZERO

        return Program.from_graph(graph, self.rebuild(graph, substitute))

    def count(
        self,
        zero_inputs: Collection[int] = (),
        *,
        same: Mapping[int, int] = _NOTHING,
        signs_free: bool = True,
    ) -> int:
        """Return the number of operations that remain when some inputs are zero.

        Args:
            zero_inputs: Positions of the inputs that are zero.
            same: Positions of inputs, and of the inputs whose value they share.
            signs_free: Whether sign changes cost nothing.

        Returns:
            Non-repeated sums, products and function calls that reach an output.
        """
        graph = Graph(signs_free=signs_free)
        zero = frozenset(zero_inputs)

        def substitute(position: int) -> int:
            return ZERO if position in zero else graph.input(same.get(position, position))

        return graph.count_operations(self.rebuild(graph, substitute))

    def evaluate(self, inputs: Sequence[FloatArray]) -> list[FloatArray]:
        """Return the values of the outputs for many samples.

        Args:
            inputs: Values of each input, arrays of one shape or scalars; results have their precision.
        """
        values: list[FloatArray] = []
        precision = np.result_type(np.float32, *inputs)
        for operation, operands, number in self.nodes:
            if operation == "constant":
                value = np.array(number, precision)
            elif operation == "input":
                value = inputs[int(number)]
            else:
                arguments = [-values[a >> 1] if a & 1 else values[a >> 1] for a in operands]
                value = _EVALUATED[operation](*arguments)
            values.append(value)
        return [-values[a >> 1] if a & 1 else values[a >> 1] for a in self.outputs]


def _add_signed(graph: Graph, values: list[int], negated: list[int]) -> int:
    """Return the sum of two signed values; a difference is one operation, with or without free signs."""
    a, b = values
    if negated[0] == negated[1]:
        total = graph.add(a, b)
        return graph.negate(total) if negated[0] else total
    return graph.subtract(b, a) if negated[0] else graph.subtract(a, b)


def _translate_operation(op: int, operands: tuple[int, ...]) -> Node:
    """Return the node of one of CasADi's operations.

    Raises:
        NotImplementedError: The graph has no node for this operation.
    """
    if op == ca.OP_SQ:
        return Node("*", (operands[0], operands[0]))
    if op == ca.OP_TWICE:
        return Node("+", (operands[0], operands[0]))
    name = _UNARY.get(op) or _BINARY.get(op)
    if name is None:
        raise NotImplementedError(f"operation {op} of CasADi has no count")
    return Node(name, operands)
