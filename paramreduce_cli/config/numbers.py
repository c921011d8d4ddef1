"""Numbers as people write them in YAML: 1e-3, pi/2, -2*pi/3, 1/3."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable
from typing import Annotated, Any

from pydantic import BeforeValidator, WithJsonSchema

_CONSTANTS = {"pi": math.pi, "inf": math.inf}
_BINARY: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_LONGEST = 100
_LARGEST_POWER = 64


def parse_number(value: Any) -> float:
    """Read a number or a small arithmetic expression.

    Args:
        value: A number, or text made of numbers, ``pi``, ``inf``, + - * / ** and brackets.

    Raises:
        ValueError: It is neither.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"{value!r} is not a number; write one such as 0.5, 1e-3 or pi/2")
    if isinstance(value, int | float):
        result = float(value)
    else:
        try:
            if len(value) > _LONGEST:
                raise ValueError("too long")
            result = _evaluate(ast.parse(value.strip(), mode="eval").body)
        except (ValueError, SyntaxError, ArithmeticError, TypeError, RecursionError) as error:
            raise ValueError(
                f"{value!r} is not a number; write one such as 0.5, 1e-3 or pi/2"
            ) from error
    if math.isnan(result):
        raise ValueError("NaN is not a number that can be used here")
    return result


def _evaluate(node: ast.expr) -> float:
    if isinstance(node, ast.Constant) and not isinstance(node.value, bool):
        if isinstance(node.value, int | float):
            return float(node.value)
        raise ValueError("not a number")
    if isinstance(node, ast.Name) and node.id in _CONSTANTS:
        return _CONSTANTS[node.id]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.UAdd | ast.USub):
        operand = _evaluate(node.operand)
        return -operand if isinstance(node.op, ast.USub) else operand
    if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
        left, right = _evaluate(node.left), _evaluate(node.right)
        if isinstance(node.op, ast.Pow) and abs(right) > _LARGEST_POWER:
            raise ValueError("power too large")
        result = _BINARY[type(node.op)](left, right)
        if isinstance(result, complex):
            raise ValueError("not real")
        return result
    raise ValueError("not arithmetic")


_LARGEST = 1e12


def _ordinary(value: Any) -> float:
    """A number of a size that a machine can have and arithmetic can bear."""
    result = parse_number(value)
    if abs(result) > _LARGEST:
        raise ValueError(f"{result:g} is too large; numbers go up to {_LARGEST:g}")
    return result


def _whole(value: Any) -> int:
    result = _ordinary(value)
    if result != int(result):
        raise ValueError(f"{value!r} is not a whole number")
    return int(result)


_TEXT_OR_NUMBER = WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "string"}]})

Number = Annotated[float, BeforeValidator(_ordinary), _TEXT_OR_NUMBER]
"""A finite float that may be written as arithmetic, such as ``pi/2``."""
Limit = Annotated[float, BeforeValidator(parse_number), _TEXT_OR_NUMBER]
"""The same, or ``inf`` for no limit."""
Whole = Annotated[int, BeforeValidator(_whole), _TEXT_OR_NUMBER]
"""A whole number that may be written as arithmetic, such as ``1e3``."""
