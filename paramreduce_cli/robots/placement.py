"""Points, directions and frames in a YAML file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BeforeValidator, WithJsonSchema, model_validator

from paramreduce_cli.fields.numbers import Number
from paramreduce_cli.fields.section import SCALAR, VECTOR, Section, Triple
from paramreduce_cli.records import FloatArray
from paramreduce_cli.robots.frames import rotate_x, rotate_y, rotate_z, translate


class Step(Section):
    """One step of a placement: a shift or a turn, in the frame reached so far."""

    xyz: Triple | None = None
    """Shift along x, y and z, m."""
    rx: Number | None = None
    """Turn about x, rad."""
    ry: Number | None = None
    """Turn about y, rad."""
    rz: Number | None = None
    """Turn about z, rad."""

    @model_validator(mode="after")
    def _check_single_step(self) -> Step:
        """Raise ValueError unless the step has one key."""
        if len(self.model_fields_set) != 1:
            raise ValueError("a step is one of xyz, rx, ry, rz; write one step per item")
        return self


def _list_steps(value: Any) -> Any:
    """Return a list of steps from a single step, a single point, or a list of steps."""
    if isinstance(value, dict):
        return [value]
    if isinstance(value, list) and value and not any(isinstance(v, dict | list) for v in value):
        return [{"xyz": value}]
    return value


_STEP = {
    "type": "object",
    "properties": {"xyz": VECTOR, "rx": SCALAR, "ry": SCALAR, "rz": SCALAR},
    "additionalProperties": False,
    "minProperties": 1,
    "maxProperties": 1,
}
_NAME = {"type": "string"}
_PLACE = {"anyOf": [VECTOR, _STEP, _NAME, {"type": "array", "items": {"anyOf": [_STEP, _NAME]}}]}
ONE_PLACE_OR_TWO = WithJsonSchema({"anyOf": [_NAME, {"type": "array", "items": _PLACE}]})
"""Two places, or the name of a point for both."""
Placement = Annotated[list[Step], BeforeValidator(_list_steps), WithJsonSchema(_PLACE)]
"""A point [x, y, z], or steps that are taken one after the other; names of points are replaced before."""


_NAMED_DIRECTIONS = {
    f"{sign}{name}": [float(f"{sign}1") if k == n else 0.0 for k in range(3)]
    for sign in ("", "-")
    for n, name in enumerate("xyz")
}


def _read_direction(value: Any) -> Any:
    return _NAMED_DIRECTIONS.get(value, value) if isinstance(value, str) else value


def _check_direction(value: list[float]) -> list[float]:
    """Return a direction, or raise ValueError if its length is zero."""
    if not any(value):
        raise ValueError("a direction needs a length; write x, y, z, -x, ... or [x, y, z]")
    return value


DIRECTION = {
    "anyOf": [{"enum": list(_NAMED_DIRECTIONS)}, {"type": "string", "pattern": "^-?to "}, VECTOR]
}
Direction = Annotated[
    Triple,
    BeforeValidator(_read_direction),
    AfterValidator(_check_direction),
    WithJsonSchema(DIRECTION),
]
"""``x``, ``y``, ``z``, ``-x``, ... or [x, y, z] of any length."""


def compose_steps(steps: Sequence[Step]) -> FloatArray:
    """Return the homogeneous transform, (4, 4), m, of steps that follow each other."""
    turns = {"rx": rotate_x, "ry": rotate_y, "rz": rotate_z}
    result = np.eye(4)
    for step in steps:
        if step.xyz is not None:
            result = result @ translate(*step.xyz)
        for key, rotation in turns.items():
            angle = getattr(step, key)
            if angle is not None:
                result = result @ rotation(angle)
    return result
