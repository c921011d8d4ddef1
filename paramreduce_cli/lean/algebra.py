"""Scalars of an expression graph with the usual operators."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, TypeVar, cast

from paramreduce_cli.expressions.graph import ZERO, Graph

F = TypeVar("F", bound=Callable[..., Any])

_MOST = 1 << 12
"""Results that are remembered of each function."""
_remembering: list[Any] = []


def cache_expressions(function: F) -> F:
    """Return a function of expressions that is evaluated once for equal arguments.

    The formulations in a search differ at one joint, so most expressions are the same.
    """
    known = lru_cache(_MOST)(function)
    _remembering.append(known)
    return cast(F, known)


def forget() -> None:
    """Drop all that is remembered, and the graphs that it is of."""
    for known in _remembering:
        known.cache_clear()


class Scalar:
    """A value of a graph.

    Args:
        graph: Graph that results are added to.
        value: Signed reference of the node.
    """

    __slots__ = ("graph", "value")

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scalar) and other.value == self.value and other.graph is self.graph

    def __hash__(self) -> int:
        return self.value

    def __init__(self, graph: Graph, value: int) -> None:
        self.graph = graph
        self.value = value

    def __add__(self, other: Scalar | float) -> Scalar:
        value = other.value if isinstance(other, Scalar) else self.graph.constant(other)
        return Scalar(self.graph, self.graph.add(self.value, value))

    def __sub__(self, other: Scalar | float) -> Scalar:
        value = other.value if isinstance(other, Scalar) else self.graph.constant(other)
        return Scalar(self.graph, self.graph.subtract(self.value, value))

    def __mul__(self, other: Scalar | float) -> Scalar:
        value = other.value if isinstance(other, Scalar) else self.graph.constant(other)
        return Scalar(self.graph, self.graph.multiply(self.value, value))

    __radd__ = __add__
    __rmul__ = __mul__

    def __neg__(self) -> Scalar:
        return Scalar(self.graph, self.graph.negate(self.value))

    def __bool__(self) -> bool:
        """Whether it is anything but the constant zero."""
        return self.value != ZERO

    def take_sine(self) -> Scalar:
        """Return the sine of an angle."""
        return Scalar(self.graph, self.graph.call("sin", self.value))

    def take_cosine(self) -> Scalar:
        """Return the cosine of an angle."""
        return Scalar(self.graph, self.graph.call("cos", self.value))

    def invert(self) -> Scalar:
        """Return the reciprocal."""
        return Scalar(self.graph, self.graph.call("inv", self.value))

    def sign(self) -> Scalar:
        """Return the sign: -1, 0 or 1."""
        return Scalar(self.graph, self.graph.call("sign", self.value))

    def take_tanh(self) -> Scalar:
        """Return the hyperbolic tangent."""
        return Scalar(self.graph, self.graph.call("tanh", self.value))
