"""Numbers as people write them in YAML: 1e-3, pi/2, -2*pi/3, 90deg, 1/3, or 0.9*(R - r) with constants.

The constants of a config reach the numbers as pydantic's validation context.
"""

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping
from typing import Annotated, Any

from pydantic import BeforeValidator, ValidationInfo, WithJsonSchema

RATHER_DEGREES = 25.0
"""Positions beyond this, in rad, are rather degrees."""
_CONSTANTS = {"pi": math.pi, "inf": math.inf, "deg": math.pi / 180}
_DEGREES = re.compile(r"(?<=[\d.)])\s*(?:deg\b|°)")
_BINARY: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_LONGEST = 100
_LARGEST_POWER = 64
_SHOWN = 80
"""Characters of a value in a message."""


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."


def parse_number(value: Any, constants: Mapping[str, float] | None = None) -> float:
    """Read a number or a small arithmetic expression.

    Args:
        value: A number, or text made of numbers, ``pi``, ``inf``, names of constants,
            + - * / ** and brackets; ``90deg`` is 90 degrees in rad.
        constants: By name.

    Raises:
        ValueError: It is neither.
    """
    known = {**_CONSTANTS, **(constants or {})}
    example = "write one such as 0.5, 1e-3, pi/2 or 90deg"
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"{_shown(value)} is not a number; {example}")
    if isinstance(value, int | float):
        result = float(value)
    else:
        try:
            if len(value) > _LONGEST:
                raise ValueError("too long")
            result = _evaluate(
                ast.parse(_DEGREES.sub("*deg", value.strip()), mode="eval").body, known
            )
        except (ValueError, SyntaxError, ArithmeticError, TypeError, RecursionError) as error:
            if constants:
                example += f", or with the constants {', '.join(constants)}"
            raise ValueError(f"{_shown(value)} is not a number; {example}") from error
    if math.isnan(result):
        raise ValueError("NaN is not a number that can be used here")
    return result


def _evaluate(node: ast.expr, known: Mapping[str, float]) -> float:
    if isinstance(node, ast.Constant) and not isinstance(node.value, bool):
        if isinstance(node.value, int | float):
            return float(node.value)
        raise ValueError("not a number")
    if isinstance(node, ast.Name) and node.id in known:
        return known[node.id]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.UAdd | ast.USub):
        operand = _evaluate(node.operand, known)
        return -operand if isinstance(node.op, ast.USub) else operand
    if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
        left, right = _evaluate(node.left, known), _evaluate(node.right, known)
        if isinstance(node.op, ast.Pow) and abs(right) > _LARGEST_POWER:
            raise ValueError("power too large")
        result = _BINARY[type(node.op)](left, right)
        if isinstance(result, complex):
            raise ValueError("not real")
        return result
    raise ValueError("not arithmetic")


_LARGEST = 1e12


def _limit(value: Any, info: ValidationInfo) -> float:
    return parse_number(value, (info.context or {}).get("constants"))


def _ordinary(value: Any, info: ValidationInfo) -> float:
    """A number of a size that a machine can have and arithmetic can bear."""
    result = _limit(value, info)
    if abs(result) > _LARGEST:
        raise ValueError(f"{result:g} is too large; numbers go up to {_LARGEST:g}")
    return result


def _whole(value: Any, info: ValidationInfo) -> int:
    result = _ordinary(value, info)
    if result != int(result):
        raise ValueError(f"{value!r} is not a whole number")
    return int(result)


def read_constants(given: Any) -> tuple[dict[str, float], dict[str, str]]:
    """Values of a config's ``constants``, each of which may use those above it.

    Returns:
        Values by name, and what is wrong by name. What cannot be read counts as one, so that
        only its own key is reported.
    """
    values: dict[str, float] = {}
    wrong: dict[str, str] = {}
    for name, value in given.items() if isinstance(given, dict) else ():
        if not name.isidentifier() or name in _CONSTANTS:
            wrong[name] = (
                "cannot be the name of a constant; use letters, digits and _, not pi, inf or deg"
            )
            continue
        try:
            values[name] = parse_number(value, values)
        except ValueError as error:
            values[name], wrong[name] = 1.0, str(error)
    return values, wrong


_TEXT_OR_NUMBER = WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "string"}]})

Number = Annotated[float, BeforeValidator(_ordinary), _TEXT_OR_NUMBER]
"""A finite float that may be written as arithmetic, such as ``pi/2``."""
Limit = Annotated[float, BeforeValidator(_limit), _TEXT_OR_NUMBER]
"""The same, or ``inf`` for no limit."""
Whole = Annotated[
    int,
    BeforeValidator(_whole),
    WithJsonSchema({"anyOf": [{"type": "integer"}, {"type": "string"}]}),
]
"""A whole number that may be written as arithmetic, such as ``1e3``."""
