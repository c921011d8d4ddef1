"""Units for the intermediate results of a program, in which products with constants vanish.

Where some inputs may come in units of any size, as parameters that are fitted anyway, so may all that is made of
them; and in a unit of length that is one of a mechanism's own, no product with that length is left. With s the
logarithm of how many times what it was a value is, a sum has the s of both its operands, a product has the sum of
theirs, other inputs and outputs have none, nor what functions are taken of and give. A product with a constant c can make up for any difference between
what it has and its operand has; if that is -log c, it is no more than its operand.
"""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from paramreduce_cli.expressions.graph import Graph, Node
from paramreduce_cli.expressions.programs import Program
from paramreduce_cli.records import FloatArray

_ROUNDING = 1e-9
"""Rounding of coefficients of equations in s, and of numbers."""
_DIGITS = 6
"""To which equations are told apart."""


def rescale(program: Program, n: int) -> tuple[Program, FloatArray]:
    """Return the same function of inputs in other units, chosen so that few products with constants are left.

    Products with constants that one choice of units removes together are removed first, the largest such set before
    others; later sets only as far as the units are still free.

    Args:
        program: Program of sums, products and functions, numbers folded as a :class:`Graph` folds them.
        n: Number of inputs, the first ones, whose units may change.

    Returns:
        The program, and the sizes of the new units of these inputs, (n,): an input has its former value divided by its
        size.
    """
    units = _Units(program, n)
    units.eliminate_products()
    sizes = np.ones(n)
    for k, node in enumerate(program.nodes):
        if node.operation == "input" and node.number < n:
            sizes[int(node.number)] = 1 / units.compute_factor(k)
    return _Rescaler(program, units).build(), sizes


class _Rescaler:
    """A builder of a program in new units.

    Args:
        program: Program before rescaling.
        units: Units of its nodes.
    """

    def __init__(self, program: Program, units: _Units) -> None:
        self._program, self._units = program, units
        self._graph = Graph()
        self._values: list[int] = []
        # Numbers between which there is only rounding must be one, or their products are not shared.
        self._numbers = [
            1.0,
            *(node.number for node in program.nodes if node.operation == "constant"),
        ]

    def build(self) -> Program:
        """Return the program in the new units."""
        for k, node in enumerate(self._program.nodes):
            self._values.append(self._build_node(k, node))
        return Program.from_graph(self._graph, [self._get_value(v) for v in self._program.outputs])

    def _get_value(self, value: int) -> int:
        """Return the rescaled reference of a node."""
        found = self._values[value >> 1]
        return self._graph.negate(found) if value & 1 else found

    def _build_node(self, k: int, node: Node) -> int:
        """Build node k in its new unit."""
        operation, operands, number = node
        if operation == "constant":
            return self._graph.constant(number)
        if operation == "input":
            return self._graph.input(int(number))
        moved = [self._get_value(value) for value in operands]
        for place, value in enumerate(operands):
            constant = self._units.get_constant(value)
            if constant is not None and operation in ("+", "*"):
                factor = self._units.compute_factor(k)
                if operation == "*":
                    factor /= self._units.compute_factor(operands[1 - place] >> 1)
                moved[place] = self._make_constant(constant * factor)
        if operation == "+":
            return self._graph.add(*moved)
        if operation == "*":
            return self._graph.multiply(*moved)
        return self._graph.call(operation, *moved)

    def _make_constant(self, number: float) -> int:
        """Return the node of a constant; numbers that differ only by rounding share a node."""
        size = abs(number)
        same = (one for one in self._numbers if abs(one - size) <= _ROUNDING * size)
        known = next(same, None)
        if known is None:
            self._numbers.append(size)
        return self._graph.constant(math.copysign(size if known is None else known, number))


class _Units:
    """The logarithms of the factors by which the values of nodes change, as far as equations between nodes fix these
    factors.

    Args:
        program: Program whose nodes get units.
        n: Number of inputs that may have a unit.
    """

    def __init__(self, program: Program, n: int) -> None:
        self._nodes = program.nodes
        by_constants = ((k, self._split_constant(k)) for k in range(len(self._nodes)))
        self._products = {k: found for k, found in by_constants if found is not None}
        inputs = [
            k for k, node in enumerate(self._nodes) if node.operation == "input" and node.number < n
        ]
        # The s of these are open. That of any node is a combination of them, and a number, which comes last.
        self._s = np.zeros((len(self._nodes), len(self._products) + len(inputs) + 1))
        self._s[[*self._products, *inputs], range(self._s.shape[1] - 1)] = 1.0
        for k in range(len(self._nodes)):
            self._propagate(k)
        for value in program.outputs:
            self._satisfy(self._s[value >> 1].copy())

    def get_constant(self, value: int) -> float | None:
        """Return the number of a value if it is a constant, else None."""
        node = self._nodes[value >> 1]
        if node.operation != "constant":
            return None
        return -node.number if value & 1 else node.number

    def compute_factor(self, k: int) -> float:
        """Return the factor between a node's new and its original value."""
        return float(np.exp(self._s[k, -1]))

    def eliminate_products(self) -> None:
        """Make products with constants vanish, first those of which most vanish together."""
        found: dict[tuple[float, ...], int] = {}
        counts: Counter[tuple[float, ...]] = Counter()
        for k in self._products:
            equation = self._make_equation(k)
            (open_ones,) = np.nonzero(np.abs(equation[:-1]) > _ROUNDING)
            if open_ones.size:
                key = tuple(np.round(equation / equation[open_ones[0]], _DIGITS).tolist())
                found.setdefault(key, k)
                counts[key] += 1
        for key, _ in counts.most_common():
            self._satisfy(self._make_equation(found[key]))

    def _make_equation(self, k: int) -> FloatArray:
        """Return the equation that makes a product with a constant equal to its operand."""
        constant, other = self._products[k]
        equation = self._s[k] - self._s[other]
        equation[-1] += np.log(constant)
        return equation

    def _satisfy(self, equation: FloatArray) -> None:
        """Fix one free scale so that an equation holds, if a free scale is left."""
        sizes = np.abs(equation[:-1])
        if np.any(sizes > _ROUNDING):
            place = int(np.argmax(sizes))
            self._s -= np.outer(self._s[:, place], equation / equation[place])

    def _split_constant(self, k: int) -> tuple[float, int] | None:
        """Return constant and other operand of a product with a constant, or None."""
        operation, operands, _ = self._nodes[k]
        if operation != "*":
            return None
        for value, other in (operands, operands[::-1]):
            if (constant := self.get_constant(value)) is not None:
                return abs(constant), other >> 1
        return None

    def _propagate(self, k: int) -> None:
        """Set the scale of a node from its operands."""
        operation, operands, _ = self._nodes[k]
        # A number can come in any unit.
        below = [value >> 1 for value in operands if self.get_constant(value) is None]
        if operation == "*" and len(below) == 2:
            self._s[k] = self._s[below[0]] + self._s[below[1]]
        elif operation == "+":
            self._satisfy(self._s[below[0]] - self._s[below[-1]])
            self._s[k] = self._s[below[0]]
        elif operation not in ("*", "+", "input", "constant"):
            for node in below:
                self._satisfy(self._s[node].copy())
