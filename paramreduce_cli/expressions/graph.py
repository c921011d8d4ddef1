"""Hash-consed expression graphs.

A node's key says everything it computes, so that equal subexpressions are one node whatever
way they were built. A value is a signed reference to a node, as one integer: twice the node's
number, plus one if it is negated. Constants are folded, zeros and ones vanish as they are met.
"""

from collections import defaultdict
from typing import NamedTuple

ZERO = 0
"""The value of the constant zero in every graph."""
_ODD = frozenset({"sin", "tan", "asin", "atan", "inv", "sign", "tanh"})
_EVEN = frozenset({"cos"})


class Node(NamedTuple):
    """A node: a constant, an input, or an operation on values."""

    operation: str
    """``constant``, ``input``, ``+``, ``*`` or the name of a function."""
    operands: tuple[int, ...] = ()
    number: float = 0.0
    """Number of a constant, its size; of an input, its position."""


class Graph:
    """A growing set of nodes, each made once. A reference to node k is the integer 2 k, or 2 k + 1 for its negative.

    Args:
        signs_free: Whether signs are part of references, and so cost nothing; if not, a negation is a node like any
            other.
    """

    def __init__(self, *, signs_free: bool = True) -> None:
        self._signs_free = signs_free
        self.nodes: list[Node] = []
        # One index an operation: short keys are quick to hash, and sums and products are asked for millions of times.
        self._indices: dict[str, dict[tuple[int, ...], int]] = defaultdict(dict)
        self._sums, self._products = self._indices["+"], self._indices["*"]
        self._inputs: dict[int, int] = {}
        self._constants: dict[float, int] = {}
        self._numbers: dict[int, float] = {}
        """Constants, by the numbers of their nodes."""
        self.constant(0.0)

    def _append(self, node: Node) -> int:
        """Append a node, and return its reference."""
        self.nodes.append(node)
        return 2 * len(self.nodes) - 2

    def _make_value(self, operation: str, operands: tuple[int, ...]) -> int:
        """Return the reference to the node of an operation, which is added if it is new."""
        index = self._indices[operation]
        value = index.get(operands)
        if value is None:
            value = index[operands] = self._append(Node(operation, operands))
        return value

    def constant(self, number: float) -> int:
        """Return the reference to a constant, which gets a node if it is new; a negative one is the negated node of its
        size.
        """
        size = abs(number)
        value = self._constants.get(size)
        if value is None:
            value = self._constants[size] = self._append(Node("constant", (), size))
            self._numbers[value >> 1] = size
        return value ^ (number < 0)

    def input(self, position: int) -> int:
        """Return the reference to an input, by position."""
        value = self._inputs.get(position)
        if value is None:
            value = self._inputs[position] = self._append(Node("input", (), position))
        return value

    def number(self, value: int) -> float | None:
        """Return the number that a reference to a constant stands for, None for other nodes."""
        number = self._numbers.get(value >> 1)
        return -number if number is not None and value & 1 else number

    def negate(self, a: int) -> int:
        """Return -a."""
        if a == ZERO:
            return a
        if self._signs_free:
            return a ^ 1
        node = self.nodes[a >> 1]
        if node.operation == "constant":
            return a ^ 1
        if node.operation == "neg":
            return node.operands[0]
        if node.operation == "+" and sum(value & 1 for value in node.operands) == 1:
            x, y = node.operands  # of a difference it is the other difference
            return self.add(x ^ 1, y ^ 1)
        return self._make_value("neg", (a,))

    def subtract(self, a: int, b: int) -> int:
        """Return a - b."""
        return self.negate(b) if a == ZERO else self.add(a, b ^ 1 if b != ZERO else b)

    def add(self, a: int, b: int) -> int:
        """Return a + b."""
        if a == ZERO:
            return b
        if b == ZERO:
            return a
        if a >> 1 == b >> 1:
            return ZERO if a != b else self.multiply(self.constant(2.0), a)
        x, y = self.number(a), self.number(b)
        if x is not None and y is not None:
            return self.constant(x + y)
        if b >> 1 < a >> 1:
            a, b = b, a
        if not self._signs_free:
            return self._make_value("+", (a, b))
        sign = a & 1
        key = (a ^ sign, b ^ sign)
        value = self._sums.get(key)
        if value is None:
            value = self._sums[key] = self._append(Node("+", key))
        return value ^ sign

    def multiply(self, a: int, b: int) -> int:
        """Return a b."""
        if a == ZERO or b == ZERO:
            return ZERO
        x, y = self.number(a), self.number(b)
        if x is not None and y is not None:
            return self.constant(x * y)
        if y is not None:
            a, b, x = b, a, y
        if x is not None:
            if abs(x) == 1.0:
                return b if x > 0 else self.negate(b)
            node = self.nodes[b >> 1]
            if node.operation == "*" and (inner := self.number(node.operands[0])) is not None:
                factor = self.constant(-x * inner if b & 1 else x * inner)
                return self.multiply(factor, node.operands[1])
        sign = (a ^ b) & 1
        a, b = a & ~1, b & ~1
        if b < a and x is None:
            a, b = b, a
        key = (a, b)
        value = self._products.get(key)
        if value is None:
            value = self._products[key] = self._append(Node("*", key))
        return value ^ sign

    def call(self, function: str, *values: int) -> int:
        """Return the reference to a function of values: sin, cos, sqrt, /, atan2, ..."""
        if values == (ZERO,) and function in ("sin", "cos", "sign", "tanh"):
            return self.constant(float(function == "cos"))
        if len(values) == 1 and self._signs_free and function in _ODD:
            return self._make_value(function, (values[0] & ~1,)) ^ (values[0] & 1)
        if function in _EVEN:
            return self._make_value(function, (values[0] & ~1,))
        return self._make_value(function, values)

    def find_reached(self, outputs: list[int]) -> list[int]:
        """Return the indices of the nodes that outputs depend on; operands come before their users."""
        seen = {value >> 1 for value in outputs}
        pending = list(seen)
        while pending:
            for value in self.nodes[pending.pop()].operands:
                node = value >> 1
                if node not in seen:
                    seen.add(node)
                    pending.append(node)
        return sorted(seen)

    def count_operations(self, outputs: list[int]) -> int:
        """Return the number of operations of outputs: all their nodes except constants and inputs."""
        return sum(
            self.nodes[node].operation not in ("constant", "input")
            for node in self.find_reached(outputs)
        )
