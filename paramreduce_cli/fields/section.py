"""Sections, and the names, numbers and lists of numbers in them."""

from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema

from paramreduce_cli.fields.numbers import Limit, Number, Whole
from paramreduce_cli.records import FloatArray

NAME = r"^[A-Za-z0-9][A-Za-z0-9_.-]*$"
Positive = Annotated[Number, Field(gt=0)]
Span = Annotated[Number, Field(ge=1e-6, le=1e6)]
Count = Annotated[Whole, Field(ge=1, le=100_000)]
CountOrNone = Annotated[Whole, Field(ge=0, le=100_000)]
Seed = Annotated[Whole, Field(ge=0)]
_NAME = {"anyOf": [{"type": "string", "pattern": NAME}, {"type": "integer"}]}
ONE_OR_MORE_NAMES = WithJsonSchema({"anyOf": [*_NAME["anyOf"], {"type": "array", "items": _NAME}]})
Name = Annotated[
    str,
    BeforeValidator(lambda value: str(value) if type(value) is int else value),
    Field(pattern=NAME),
    WithJsonSchema(_NAME),
]


def as_list(value: Any) -> Any:
    """One entry for all joints, as a list of one."""
    return value if isinstance(value, list) else [value]


def as_words(value: Any) -> Any:
    """Split words that commas part into a list."""
    return [word.strip() for word in value.split(",")] if isinstance(value, str) else value


def as_pairs(value: Any) -> Any:
    """One pair for all joints, as a list of one."""
    if isinstance(value, list) and value and not isinstance(value[0], list):
        return [value]
    return value


SCALAR = {"anyOf": [{"type": "number"}, {"type": "string"}]}
VECTOR = {"type": "array", "items": SCALAR, "minItems": 1}
_ONE_OR_EACH = WithJsonSchema({"anyOf": [*SCALAR["anyOf"], VECTOR]})
_PAIR_OR_EACH = WithJsonSchema({"anyOf": [VECTOR, {"type": "array", "items": VECTOR}]})

PerJoint = Annotated[list[Number], BeforeValidator(as_list), Field(min_length=1), _ONE_OR_EACH]
"""One number for all joints or one for each."""
PositivePerJoint = Annotated[
    list[Positive], BeforeValidator(as_list), Field(min_length=1), _ONE_OR_EACH
]
LimitPerJoint = Annotated[
    list[Annotated[Limit, Field(ge=1e-6)]],
    BeforeValidator(as_list),
    Field(min_length=1),
    _ONE_OR_EACH,
]


def per_joint(values: list[float], n: int) -> FloatArray:
    """One number for all joints or one for each, as one for each, (n,)."""
    return np.full(n, values[0]) if len(values) == 1 else np.array(values, dtype=float)


Triple = Annotated[list[Number], Field(min_length=3, max_length=3)]
Pair = Annotated[list[Number], Field(min_length=2, max_length=2)]
PairPerJoint = Annotated[list[Pair], BeforeValidator(as_pairs), Field(min_length=1), _PAIR_OR_EACH]
"""One [lower, upper] for all joints or one for each."""


class Section(BaseModel):
    """A mapping in which unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)
