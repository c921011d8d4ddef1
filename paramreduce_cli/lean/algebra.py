"""Scalars of an expression graph with the usual operators."""

from __future__ import annotations

from paramreduce_cli.expressions.graph import ZERO, Graph


class Scalar:
    """A value of a graph.

    Args:
        graph: Where results go.
        value: Its signed reference.
    """

    __slots__ = ("graph", "value")

    def __init__(self, graph: Graph, value: int) -> None:
        self.graph = graph
        self.value = value

    def __add__(self, other: Scalar | float) -> Scalar:
        return Scalar(self.graph, self.graph.add(self.value, self._of(other)))

    def __sub__(self, other: Scalar | float) -> Scalar:
        return Scalar(self.graph, self.graph.subtract(self.value, self._of(other)))

    def __mul__(self, other: Scalar | float) -> Scalar:
        return Scalar(self.graph, self.graph.multiply(self.value, self._of(other)))

    __radd__ = __add__
    __rmul__ = __mul__

    def __neg__(self) -> Scalar:
        return Scalar(self.graph, self.graph.negate(self.value))

    def __bool__(self) -> bool:
        """Whether it is anything but the constant zero."""
        return self.value != ZERO

    def _of(self, other: Scalar | float) -> int:
        return other.value if isinstance(other, Scalar) else self.graph.constant(other)

    def sine(self) -> Scalar:
        """The sine of an angle."""
        return Scalar(self.graph, self.graph.call("sin", self.value))

    def cosine(self) -> Scalar:
        """The cosine of an angle."""
        return Scalar(self.graph, self.graph.call("cos", self.value))
