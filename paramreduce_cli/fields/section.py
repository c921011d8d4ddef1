"""Base class of sections, and lists of values for all joints or for each."""

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


def wrap_in_list(value: Any) -> Any:
    """Return a value that is not a list as a list with one entry, which holds for all joints."""
    return value if isinstance(value, list) else [value]


def split_words(value: Any) -> Any:
    """Return the words of a text, split at commas."""
    return [word.strip() for word in value.split(",")] if isinstance(value, str) else value


def wrap_pair(value: Any) -> Any:
    """Return a single pair as a list with one entry, which holds for all joints."""
    if isinstance(value, list) and value and not isinstance(value[0], list):
        return [value]
    return value


SCALAR = {"anyOf": [{"type": "number"}, {"type": "string"}]}
VECTOR = {"type": "array", "items": SCALAR, "minItems": 1}
_ONE_OR_EACH = WithJsonSchema({"anyOf": [*SCALAR["anyOf"], VECTOR]})
_PAIR_OR_EACH = WithJsonSchema({"anyOf": [VECTOR, {"type": "array", "items": VECTOR}]})

PerJoint = Annotated[list[Number], BeforeValidator(wrap_in_list), Field(min_length=1), _ONE_OR_EACH]
"""One number for all joints or one for each."""
PositivePerJoint = Annotated[
    list[Positive], BeforeValidator(wrap_in_list), Field(min_length=1), _ONE_OR_EACH
]
LimitPerJoint = Annotated[
    list[Annotated[Limit, Field(ge=1e-6)]],
    BeforeValidator(wrap_in_list),
    Field(min_length=1),
    _ONE_OR_EACH,
]


def expand_per_joint(values: list[float], n: int) -> FloatArray:
    """Return a value for every joint, (n,), from one value for all joints or one for each."""
    return np.full(n, values[0]) if len(values) == 1 else np.array(values, dtype=float)


Triple = Annotated[list[Number], Field(min_length=3, max_length=3)]
Pair = Annotated[list[Number], Field(min_length=2, max_length=2)]
PairPerJoint = Annotated[list[Pair], BeforeValidator(wrap_pair), Field(min_length=1), _PAIR_OR_EACH]
"""One [lower, upper] for all joints or one for each."""


class Section(BaseModel):
    """A section of the config; unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)
