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
"""Size of a position, rad, beyond which it was probably written in degrees."""
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
"""Characters of a value that a message shows."""


def _abbreviate(value: Any) -> str:
    """Return a value as text, cut off if it is too long."""
    text = repr(value)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."


def parse_number(value: Any, constants: Mapping[str, float] | None = None) -> float:
    """Return the value of a number or a small arithmetic expression.

    Args:
        value: A number, or text made of numbers, ``pi``, ``inf``, names of constants,
            + - * / ** and brackets; ``90deg`` is 90 degrees in rad.
        constants: Values of constants by name.

    Raises:
        ValueError: The value is neither a number nor an expression, or is NaN.
    """
    known = {**_CONSTANTS, **(constants or {})}
    example = "write one such as 0.5, 1e-3, pi/2 or 90deg"
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"{_abbreviate(value)} is not a number; {example}")
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
            raise ValueError(f"{_abbreviate(value)} is not a number; {example}") from error
    if math.isnan(result):
        raise ValueError("NaN is not a number that can be used here")
    return result


def _evaluate(node: ast.expr, constants: Mapping[str, float]) -> float:
    """Return the value of a syntax tree, or raise ValueError if it is no arithmetic on known names."""
    if isinstance(node, ast.Constant) and not isinstance(node.value, bool):
        if isinstance(node.value, int | float):
            return float(node.value)
        raise ValueError("not a number")
    if isinstance(node, ast.Name) and node.id in constants:
        return constants[node.id]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.UAdd | ast.USub):
        operand = _evaluate(node.operand, constants)
        return -operand if isinstance(node.op, ast.USub) else operand
    if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
        left, right = _evaluate(node.left, constants), _evaluate(node.right, constants)
        if isinstance(node.op, ast.Pow) and abs(right) > _LARGEST_POWER:
            raise ValueError("power too large")
        result = _BINARY[type(node.op)](left, right)
        if isinstance(result, complex):
            raise ValueError("not real")
        return result
    raise ValueError("not arithmetic")


_LARGEST = 1e12


def _validate_limit(value: Any, info: ValidationInfo) -> float:
    return parse_number(value, (info.context or {}).get("constants"))


def _validate_number(value: Any, info: ValidationInfo) -> float:
    """Return a number, or raise ValueError if it is larger than any quantity of a machine."""
    result = _validate_limit(value, info)
    if abs(result) > _LARGEST:
        raise ValueError(f"{result:g} is too large; numbers go up to {_LARGEST:g}")
    return result


def _validate_whole(value: Any, info: ValidationInfo) -> int:
    """Return a whole number, or raise ValueError if it has decimals."""
    try:
        result = _validate_number(value, info)
    except ValueError as error:
        raise ValueError(
            f"expected a whole number, for example 1, not {_abbreviate(value)}"
        ) from error
    if not math.isfinite(result) or result != int(result):
        raise ValueError(f"expected a whole number, for example 1, not {_abbreviate(value)}")
    return int(result)


def read_constants(given: Any) -> tuple[dict[str, float], dict[str, str]]:
    """Return the values of a config's ``constants``, each of which may use earlier ones.

    Returns:
        Values by name, and messages on unreadable constants by name. An unreadable constant has the value 1, so that
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

Number = Annotated[float, BeforeValidator(_validate_number), _TEXT_OR_NUMBER]
"""A finite float that may be written as arithmetic, such as ``pi/2``."""
Limit = Annotated[float, BeforeValidator(_validate_limit), _TEXT_OR_NUMBER]
"""A number that may be written as arithmetic, or ``inf`` for no limit."""
Whole = Annotated[
    int,
    BeforeValidator(_validate_whole),
    WithJsonSchema({"anyOf": [{"type": "integer"}, {"type": "string"}]}),
]
"""A whole number that may be written as arithmetic, such as ``1e3``."""
