"""Straight-line functions as text: what differs between languages, and what does not."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.expressions.functions import Argument, Function
from paramreduce_cli.expressions.graph import Node

FUNCTIONS = ("sin", "cos", "tan", "asin", "acos", "atan", "sqrt", "atan2", "tanh", "sign")
"""That expressions may call."""


@dataclass(frozen=True)
class Language:
    """A language with its way to write expressions."""

    calls: Mapping[str, str]
    """Names of :data:`FUNCTIONS` in the language."""
    number: Callable[[float], str]
    """Function that writes a constant."""
    element: Callable[[Argument, int], str]
    """An element of an array, by its position row by row."""
    one: str = "1"
    """The number one as a dividend."""

    def write_leaves(self, function: Function) -> dict[int, str]:
        """Return the texts of constants and inputs, by node."""
        positions = function.list_positions(function.arguments)
        names = {}
        for number, node in enumerate(function.program.nodes):
            if node.operation == "constant":
                names[number] = self.number(node.number)
            elif node.operation == "input":
                names[number] = self.element(*positions[int(node.number)])
        return names

    def write_expression(self, names: Mapping[int, str], node: Node) -> str:
        """Return the text of an operation whose operands have names."""
        operation, operands = (
            node.operation,
            [write_signed(names, value) for value in node.operands],
        )
        if operation == "inv":
            return f"{self.one} / {names[node.operands[0] >> 1]}"
        if operation in self.calls:
            return f"{self.calls[operation]}({', '.join(operands)})"
        a, b = operands
        if not b.startswith("-"):
            return f"{a} {operation} {b}"
        return f"{a} - {b[1:]}" if operation == "+" else f"{a} {operation} ({b})"

    def write_body(self, function: Function) -> tuple[list[tuple[str, str]], list[str]]:
        """Return names and texts of the operations in order, and the texts of the results."""
        names = self.write_leaves(function)
        lines = []
        for number, node in function.iterate_steps():
            lines.append((f"t{number}", self.write_expression(names, node)))
            names[number] = f"t{number}"
        return lines, [write_signed(names, value) for value in function.program.outputs]


def write_signed(names: Mapping[int, str], value: int) -> str:
    """Return a signed reference as text."""
    return f"-{names[value >> 1]}" if value & 1 else names[value >> 1]


def write_float(value: float, *, single: bool) -> str:
    """Return a number with a point or an exponent; with ``single``, numbers too small for single precision are zero.

    Compilers warn of numbers that single precision is too coarse for.
    """
    if single and np.float32(value) == 0:
        value = 0.0
    text = repr(float(value))
    return text if any(mark in text for mark in ".en") else f"{text}.0"
