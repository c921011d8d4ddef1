"""How a config describes a mechanism: Denavit-Hartenberg tables, or bodies, joints and closures."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema, model_validator

from paramreduce_cli.config.numbers import Number
from paramreduce_cli.config.section import (
    ONE_OR_MORE_NAMES,
    SCALAR,
    VECTOR,
    Name,
    Positive,
    Section,
    as_list,
)
from paramreduce_cli.records import JOINT_AXES, JOINT_COORDINATES


class DHJoint(Section):
    """One row of a Denavit-Hartenberg table."""

    name: Name | None = None
    """Name of the body; its number in the table if left out. Parameters are called after it: m_3."""
    parent: Name | None = None
    """Body it is mounted on, `base` for the base; if left out the row above, or the base for the first."""
    type: Literal["revolute", "prismatic"] = "revolute"
    """Kind of joint: `revolute` turns about z, `prismatic` slides along z."""
    a: Number = 0.0
    """Length along x, m."""
    alpha: Number = 0.0
    """Angle about x, rad."""
    d: Number = 0.0
    """Length along z, m; the offset of the coordinate for a prismatic joint."""
    theta: Number = 0.0
    """Angle about z, rad; the offset of the coordinate for a revolute joint."""
    gamma: Number = 0.0
    """Angle about the parent's z that places a branch [Khalil2002], rad."""
    b: Number = 0.0
    """Length along the parent's z that places a branch [Khalil2002], m."""


class DHDescription(Section):
    """A tree of bodies in Denavit-Hartenberg parameters."""

    convention: Literal["modified", "standard"] = "modified"
    """`modified` as in Khalil and Craig: frame i on the axis of joint i; `standard`: on the axis of joint i + 1."""
    joints: Annotated[list[DHJoint], Field(min_length=1)]
    """One row per body, parents above their children."""


Vector = Annotated[list[Number], Field(min_length=3, max_length=3)]


class Step(Section):
    """One step of a placement: a shift or a turn, in the frame reached so far."""

    xyz: Vector | None = None
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


_DIRECTION = {"anyOf": [{"enum": list(_NAMED_DIRECTIONS)}, VECTOR]}
Direction = Annotated[
    Vector,
    BeforeValidator(_as_direction),
    AfterValidator(_not_zero),
    WithJsonSchema(_DIRECTION),
]
"""``x``, ``y``, ``z``, ``-x``, ... or [x, y, z] of any length."""


def _as_directions(value: Any) -> Any:
    plain = isinstance(value, list) and value and isinstance(value[0], int | float)
    return [value] if plain or not isinstance(value, list) else value


_ONE_OR_MORE_DIRECTIONS = WithJsonSchema(
    {"anyOf": [_DIRECTION, {"type": "array", "items": _DIRECTION}]}
)

JointKind = Literal["revolute", "prismatic", "universal", "spherical", "free"]


class TreeBody(Section):
    """A body and the joint that carries it."""

    name: Name
    """Name of the body; parameters are called after it: m_NAME."""
    parent: Name = "base"
    """Body it is mounted on."""
    joint: JointKind = "revolute"
    """`universal` turns about two axes, `spherical` about x, y and z, `free` slides along x, y and z, then turns about them."""
    axes: Annotated[list[Direction], BeforeValidator(_as_directions), _ONE_OR_MORE_DIRECTIONS] = []
    """Axes of the joint in its frame; if left out z, or x and y for a universal joint."""
    at: Placement = []
    """The joint's frame in the parent's: a point, or steps; the body's frame is there at zero coordinates."""
    coordinates: Annotated[list[Name], BeforeValidator(as_list), ONE_OR_MORE_NAMES] = []
    """Names of the joint's coordinates; if left out q_NAME, or q_NAME_1, q_NAME_2, ..."""
    massless: bool = False
    """Whether the body has no mass and so no parameters."""

    @model_validator(mode="after")
    def _counts(self) -> TreeBody:
        axes, coordinates = JOINT_AXES[self.joint], JOINT_COORDINATES[self.joint]
        if self.axes and len(self.axes) != axes:
            raise ValueError(f"a {self.joint} joint takes {axes} axes, not {len(self.axes)}")
        if self.coordinates and len(self.coordinates) != coordinates:
            raise ValueError(
                f"a {self.joint} joint has {coordinates} coordinates, not {len(self.coordinates)}"
            )
        return self

    def coordinate_names(self) -> list[str]:
        """Names of the joint's coordinates."""
        count = JOINT_COORDINATES[self.joint]
        if self.coordinates:
            return list(self.coordinates)
        if count == 1:
            return [f"q_{self.name}"]
        return [f"q_{self.name}_{k + 1}" for k in range(count)]


class ClosureSection(Section):
    """What holds two bodies of the tree together, so that a loop is closed."""

    name: Name | None = None
    """Name for messages; `loop_1`, `loop_2`, ... if left out."""
    type: Literal["point", "planar", "revolute", "distance"] = "point"
    """`point`: two points coincide (3 equations); `planar`: the second is on the z axis of the first (2); `revolute`: origins and z axes coincide (5); `distance`: two points keep a distance (1)."""
    bodies: Annotated[list[Name], Field(min_length=2, max_length=2)]
    """The two bodies, `base` for the base."""
    at: Annotated[list[Placement], Field(min_length=2, max_length=2)]
    """Where on each of them: a point or steps."""
    length: Positive | None = None
    """Of a distance, m."""

    @model_validator(mode="after")
    def _length(self) -> ClosureSection:
        if (self.type == "distance") != (self.length is not None):
            raise ValueError("length belongs to a closure of type distance, and only there")
        return self


class TreeDescription(Section):
    """Bodies and joints in frames of one's own choice, with closures that make loops of them."""

    bodies: Annotated[list[TreeBody], Field(min_length=1)]
    """One item per body, parents above their children."""
    closures: list[ClosureSection] = []
    """What closes the loops; none for an open tree."""
    independent: list[Name] = []
    """Coordinates that are actuated and determine all others; only with closures."""
    guess: dict[str, Number] = {}
    """Values of coordinates near a closed assembly, rad or m; zero for those left out. Independent ones keep them."""

    @model_validator(mode="after")
    def _with_closures(self) -> TreeDescription:
        if bool(self.closures) != bool(self.independent):
            raise ValueError("closures and independent belong together; give both or neither")
        if self.guess and not self.closures:
            raise ValueError("a guess is for closing loops, but there are no closures")
        return self

    def coordinate_names(self) -> list[str]:
        """Names of all coordinates, body by body."""
        return [name for body in self.bodies for name in body.coordinate_names()]


class Description(Section):
    """The mechanism on a fixed base: a Denavit-Hartenberg table, or bodies with joints and loops."""

    dh: DHDescription | None = None
    """Denavit-Hartenberg table of an open tree; or give tree."""
    tree: TreeDescription | None = None
    """Bodies, joints and loop closures; or give dh."""
    gravity: Annotated[list[Number], Field(min_length=3, max_length=3)] = [0.0, 0.0, -9.81]
    """Acceleration of gravity in the base frame, m/s^2."""

    @model_validator(mode="after")
    def _one_way_only(self) -> Description:
        if (self.dh is None) == (self.tree is None):
            raise ValueError("give dh or tree, one of them")
        return self

    def body_names(self) -> list[str]:
        """Names of the bodies that have parameters, in order."""
        if self.dh is not None:
            return [joint.name or str(k + 1) for k, joint in enumerate(self.dh.joints)]
        assert self.tree is not None
        return [body.name for body in self.tree.bodies if not body.massless]

    def generalised_names(self) -> list[str]:
        """Names of all coordinates."""
        if self.dh is not None:
            return [f"z_{name}" for name in self.body_names()]
        assert self.tree is not None
        return self.tree.coordinate_names()

    def coordinate_names(self) -> list[str]:
        """Names of the independent coordinates."""
        named = list(self.tree.independent) if self.tree is not None else []
        return named or self.generalised_names()
