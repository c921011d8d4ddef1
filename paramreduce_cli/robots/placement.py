"""Points, directions and placements of frames as a YAML gives them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BeforeValidator, WithJsonSchema, model_validator

from paramreduce_cli.fields.numbers import Number
from paramreduce_cli.fields.section import SCALAR, VECTOR, Section, Triple
from paramreduce_cli.records import FloatArray
from paramreduce_cli.robots.frames import rotation_x, rotation_y, rotation_z, translation


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
    def _one(self) -> Step:
        if len(self.model_fields_set) != 1:
            raise ValueError("a step is one of xyz, rx, ry, rz; write one step per item")
        return self


def _as_steps(value: Any) -> Any:
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
Placement = Annotated[
    list[Step],
    BeforeValidator(_as_steps),
    WithJsonSchema({"anyOf": [VECTOR, _STEP, {"type": "array", "items": _STEP}]}),
]
"""A point [x, y, z], or steps that are taken one after the other."""


_NAMED_DIRECTIONS = {
    f"{sign}{name}": [float(f"{sign}1") if k == n else 0.0 for k in range(3)]
    for sign in ("", "-")
    for n, name in enumerate("xyz")
}


def _as_direction(value: Any) -> Any:
    return _NAMED_DIRECTIONS.get(value, value) if isinstance(value, str) else value


def _not_zero(value: list[float]) -> list[float]:
    if not any(value):
        raise ValueError("a direction needs a length; write x, y, z, -x, ... or [x, y, z]")
    return value


DIRECTION = {"anyOf": [{"enum": list(_NAMED_DIRECTIONS)}, VECTOR]}
Direction = Annotated[
    Triple, BeforeValidator(_as_direction), AfterValidator(_not_zero), WithJsonSchema(DIRECTION)
]
"""``x``, ``y``, ``z``, ``-x``, ... or [x, y, z] of any length."""


def transform(steps: Sequence[Step]) -> FloatArray:
    """Steps one after the other as a homogeneous transform, (4, 4), m."""
    turns = {"rx": rotation_x, "ry": rotation_y, "rz": rotation_z}
    result = np.eye(4)
    for step in steps:
        if step.xyz is not None:
            result = result @ translation(*step.xyz)
        for key, turn in turns.items():
            angle = getattr(step, key)
            if angle is not None:
                result = result @ turn(angle)
    return result
