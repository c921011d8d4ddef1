"""Bodies and joints in frames of their own choice, with closures that make loops of them.

A joint of several axes becomes a chain of joints of one axis with frames between.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import BeforeValidator, Field, WithJsonSchema, model_validator

from paramreduce_cli.fields.names import Problem, UnknownNameError
from paramreduce_cli.fields.numbers import Number
from paramreduce_cli.fields.section import (
    ONE_OR_MORE_NAMES,
    Name,
    Positive,
    Section,
    Triple,
    wrap_in_list,
)
from paramreduce_cli.records import (
    BASE,
    JOINT_AXES,
    JOINT_COORDINATES,
    Body,
    Closure,
    ClosureKind,
    FloatArray,
    Loops,
)
from paramreduce_cli.robots.bodies import BodiesDescription
from paramreduce_cli.robots.frames import to_axis_angle
from paramreduce_cli.robots.placement import (
    DIRECTION,
    ONE_PLACE_OR_TWO,
    Direction,
    Placement,
    compose_steps,
)

JointMotion = tuple[Literal["revolute", "prismatic"], FloatArray]
"""A kind of motion and the direction of its axis, (3,)."""

_X, _Y, _Z = np.eye(3)
_NO_TURN = 1e-12
"""What is printed as zero, rad or m."""


def _list_directions(value: Any) -> Any:
    """Return a list of directions from a single direction or a list."""
    plain = isinstance(value, list) and value and isinstance(value[0], int | float)
    return [value] if plain or not isinstance(value, list) else value


_ONE_OR_MORE_DIRECTIONS = WithJsonSchema(
    {"anyOf": [DIRECTION, {"type": "array", "items": DIRECTION}]}
)

JointKind = Literal["revolute", "prismatic", "universal", "spherical", "free"]


def list_joint_motions(kind: str, axes: Sequence[Sequence[float]]) -> list[JointMotion]:
    """Return the motions of a joint, one after the other.

    Args:
        kind: ``revolute``, ``prismatic``, ``universal``, ``spherical`` or ``free``.
        axes: Directions of its axes, as many as :data:`JOINT_AXES` says; if empty, z for one axis,
            x then y for a universal joint. Spherical joints turn about x, y and z, free ones
            slide along them first.
    """
    if kind == "spherical":
        return [("revolute", axis) for axis in (_X, _Y, _Z)]
    if kind == "free":
        slides: list[JointMotion] = [("prismatic", axis) for axis in (_X, _Y, _Z)]
        return slides + list_joint_motions("spherical", [])
    if kind == "universal":
        first, second = axes or (_X, _Y)
        return [("revolute", np.asarray(first)), ("revolute", np.asarray(second))]
    (axis,) = axes or (_Z,)
    return [("revolute" if kind == "revolute" else "prismatic", np.asarray(axis, dtype=float))]


def rotate_z_to(axis: FloatArray) -> FloatArray:
    """Return a rotation that takes z to a direction, (3, 3), exact for the six directions of the axes."""
    unit = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    for k, direction in enumerate(np.eye(3)):
        if np.array_equal(np.abs(unit), direction):
            cyclic = np.roll(np.eye(3), k + 1, axis=0)
            return cyclic if unit[k] > 0 else cyclic @ np.diag([1.0, -1.0, -1.0])
    if unit[2] < 0:
        return rotate_z_to(-unit) @ np.diag([1.0, -1.0, -1.0])
    x, y, c = unit
    skew = np.array([[0, 0, x], [0, 0, y], [-x, -y, 0]])  # of z cross the axis
    result: FloatArray = np.eye(3) + skew + skew @ skew / (1 + c)
    return result


class TreeBody(Section):
    """A body and the joint that carries it."""

    name: Name
    """Name of the body; parameters are called after it: m_NAME."""
    parent: Name = "base"
    """Body it is mounted on."""
    joint: JointKind = "revolute"
    """`universal` turns about two axes, `spherical` about x, y and z, `free` slides along x, y and z, then turns about them."""
    axes: Annotated[
        list[Direction], BeforeValidator(_list_directions), _ONE_OR_MORE_DIRECTIONS
    ] = []
    """Axes of the joint in its frame, also `to NAME` for the direction to a named point, `-to NAME` for the opposite one; if left out z, or x and y for a universal joint."""
    at: Placement = []
    """The joint's frame in the parent's: a point, the name of a point, or steps; the body's frame is there at zero coordinates."""
    coordinates: Annotated[list[Name], BeforeValidator(wrap_in_list), ONE_OR_MORE_NAMES] = []
    """Names of the joint's coordinates; if left out q_NAME, or q_NAME_1, q_NAME_2, ..."""
    massless: bool = False
    """Whether the body has no mass and so no parameters."""

    @model_validator(mode="after")
    def _check_counts(self) -> TreeBody:
        """Raise ValueError if the joint has another number of axes or coordinates than its kind."""
        axes, coordinates = JOINT_AXES[self.joint], JOINT_COORDINATES[self.joint]
        if self.axes and len(self.axes) != axes:
            raise ValueError(f"a {self.joint} joint takes {axes} axes, not {len(self.axes)}")
        if self.coordinates and len(self.coordinates) != coordinates:
            raise ValueError(
                f"a {self.joint} joint has {coordinates} coordinates, not {len(self.coordinates)}"
            )
        return self

    def list_motions(self) -> list[JointMotion]:
        """Return the motions of the joint, one after the other."""
        return list_joint_motions(self.joint, self.axes)

    def build_chain(self, parent: int, start: int) -> list[Body]:
        """Return the bodies of one joint: massless bodies between its axes, and the named body at the end.

        Args:
            parent: Index of the body it is mounted on.
            start: Index of the first of them.
        """
        motions, coordinates = self.list_motions(), self.list_coordinates()
        chain = []
        placement = compose_steps(self.at)
        for k, (kind, axis) in enumerate(motions):
            last = k == len(motions) - 1
            rotation = np.eye(4)
            rotation[:3, :3] = rotate_z_to(axis)
            chain.append(
                Body(
                    name=self.name if last else f"{self.name}:{k + 1}",
                    parent=parent if k == 0 else start + k - 1,
                    joint=kind,
                    parent_to_joint=placement @ rotation,
                    joint_to_body=rotation.T,
                    coordinate=coordinates[k],
                    intermediate=not last,
                )
            )
            placement = np.eye(4)
        return chain

    def build_row(self) -> tuple[str, ...]:
        """Return the body's row in the table of the geometry."""
        axes = [axis for _, axis in self.list_motions()]
        return (
            self.name + (" (massless)" if self.massless else ""),
            self.parent,
            self.joint,
            "; ".join(_format_numbers(axis) for axis in axes) if len(axes) < 3 else "x y z",
            _format_placement(compose_steps(self.at)),
            " ".join(self.list_coordinates()),
        )

    def list_coordinates(self) -> list[str]:
        """Return the names of the joint's coordinates."""
        count = JOINT_COORDINATES[self.joint]
        if self.coordinates:
            return list(self.coordinates)
        if count == 1:
            return [f"q_{self.name}"]
        return [f"q_{self.name}_{k + 1}" for k in range(count)]


class ClosureSection(Section):
    """A closure that holds two bodies of the tree together, so that a loop is closed."""

    name: Name | None = None
    """Name for messages; `loop_1`, `loop_2`, ... if left out."""
    type: ClosureKind = "point"
    """`point`: two points coincide (3 equations); `planar`: the second is on the z axis of the first (2); `revolute`: origins and z axes coincide (5); `distance`: two points keep a distance (1); `fixed`: the frames coincide (6); `prismatic`: but for a shift along z (5); `cylindrical`: z axes coincide (4); `universal`: origins coincide, x of the first stays perpendicular to y of the second (4); `coupling`: the second body's coordinate is ratio times the first one's, plus offset (1)."""
    bodies: Annotated[list[Name], Field(min_length=2, max_length=2)]
    """The two bodies, `base` for the base."""
    at: Annotated[list[Placement], Field(max_length=2), ONE_PLACE_OR_TWO] = []
    """Place on each of the two bodies: a point, the name of a point, or steps; one name for both if they meet there; not for a coupling."""
    length: Positive | None = None
    """Length of a distance, m; between two named points it is their distance if left out."""
    ratio: Number | None = None
    """Ratio of a coupling; not zero."""
    offset: Number | None = None
    """Offset of a coupling, rad or m; zero if left out."""

    @model_validator(mode="after")
    def _check_keys(self) -> ClosureSection:
        """Raise ValueError if keys are given that do not belong to this type of closure."""
        coupling = self.type == "coupling"
        if (self.type == "distance") != (self.length is not None):
            raise ValueError("length belongs to a closure of type distance, and only there")
        if coupling != bool(self.ratio) or (self.offset is not None and not coupling):
            raise ValueError("ratio and offset belong to a coupling, which needs a ratio but zero")
        if len(self.at) != (0 if coupling else 2):
            raise ValueError("at says where on each of the two bodies; a coupling has none")
        return self

    def build_closure(self, number: int, index: Mapping[str, int]) -> Closure:
        """Return the closure as a record.

        Args:
            number: Number of the closure, which names it if it has no name.
            index: Indices of the bodies and the base by name.
        """
        (one, other), (first, second) = self.bodies, self.at or ([], [])
        return Closure(
            self.name or f"loop_{number}",
            self.type,
            (index[one], index[other]),
            (compose_steps(first), compose_steps(second)),
            self.length or 0.0,
            self.ratio or 1.0,
            self.offset or 0.0,
        )


class TreeDescription(BodiesDescription):
    """A description of bodies and joints in frames of the user's choice, with closures that make loops."""

    ROWS: ClassVar[str] = "bodies"

    points: dict[Name, Triple] = {}
    """Named points in the base frame while all coordinates are zero, m, such as the hardpoints of a suspension. `at`, `com` and `axes: to NAME` may use their names."""
    bodies: Annotated[list[TreeBody], Field(min_length=1)]
    """One item per body, parents above their children."""
    closures: list[ClosureSection] = []
    """Closures of the loops; none for an open tree."""
    independent: list[Name] = []
    """Coordinates that are actuated and determine all others; only with closures."""
    guess: dict[str, Number] = {}
    """Values of coordinates near a closed assembly, rad or m; zero for those left out. Independent ones keep them."""

    @model_validator(mode="after")
    def _check_closures(self) -> TreeDescription:
        """Raise ValueError unless closures and independent coordinates are given together."""
        if bool(self.closures) != bool(self.independent):
            text = (
                "has closures, but no independent; name the coordinates that are actuated and determine the others"
                if self.closures
                else "has independent, but no closures; leave out independent, also in subsystems: without loops all coordinates "
                "are independent"
            )
            raise ValueError(text)
        if self.guess and not self.closures:
            raise ValueError("a guess is for closing loops, but there are no closures")
        return self

    def list_body_names(self) -> list[str]:
        """Return the names of all bodies, in order."""
        return [body.name for body in self.bodies]

    def list_inertial_bodies(self) -> list[str]:
        """Return the names of the bodies that have inertia."""
        return [body.name for body in self.bodies if not body.massless]

    def list_parents(self) -> list[str | None]:
        """Return the name of each body's parent, as the user gave it; ``base`` for the base."""
        return [body.parent for body in self.bodies]

    def list_coordinates(self) -> list[str]:
        """Return the names of all coordinates, body by body."""
        return [name for body in self.bodies for name in body.list_coordinates()]

    @property
    def closed(self) -> bool:
        """Whether there are loops."""
        return bool(self.closures)

    def list_independent_coordinates(self) -> list[str]:
        """Return the names of the independent coordinates."""
        return list(self.independent) or self.list_coordinates()

    def list_driven_coordinates(self) -> list[str]:
        """Return the names of the independent coordinates, without those of bodies that float freely."""
        floating = [
            n for body in self.bodies if body.joint == "free" for n in body.list_coordinates()
        ]
        return [name for name in self.list_independent_coordinates() if name not in floating]

    def build_bodies(self) -> tuple[Body, ...]:
        """Return the bodies with their joints of one axis each."""
        bodies: list[Body] = []
        index = {"base": BASE}
        for row in self.bodies:
            bodies += row.build_chain(index[row.parent], len(bodies))
            index[row.name] = len(bodies) - 1
        return tuple(bodies)

    def build_loops(self) -> Loops | None:
        """Return the closures of the loops, not yet assembled, or None for an open tree."""
        if not self.closures:
            return None
        index = {"base": BASE} | {body.name: k for k, body in enumerate(self.build_bodies())}
        names = self.list_coordinates()
        return Loops(
            tuple(closure.build_closure(k + 1, index) for k, closure in enumerate(self.closures)),
            tuple(names.index(name) for name in self.independent),
            np.array([float(self.guess.get(name, 0.0)) for name in names]),
        )

    def find_problems(self) -> Iterator[Problem]:
        """Yield contradictions in the description, by the keys below this section."""
        bodies, coordinates = ["base", *self.list_body_names()], self.list_coordinates()
        for k, body in enumerate(self.bodies):
            for name in body.list_coordinates():
                if coordinates.count(name) > 1:
                    yield ("bodies", k), f"coordinate {name!r} belongs to several joints"
        several = {body.name for body in self.bodies if len(body.list_coordinates()) > 1}
        for k, closure in enumerate(self.closures):
            for j, name in enumerate(closure.bodies):
                if name not in bodies:
                    yield ("closures", k, "bodies", j), UnknownNameError("body", name, bodies)
            if closure.name is not None and closure.name in {c.name for c in self.closures[:k]}:
                yield ("closures", k, "name"), f"{closure.name!r} is taken"
            if closure.bodies[0] == closure.bodies[1]:
                yield ("closures", k, "bodies"), f"ties {closure.bodies[0]!r} to itself"
            for j, name in enumerate(closure.bodies if closure.type == "coupling" else ()):
                if name == "base" or name in several:
                    yield ("closures", k, "bodies", j), f"{name!r} has not just one coordinate"
        for k, name in enumerate(self.independent):
            if name not in coordinates:
                yield ("independent", k), UnknownNameError("coordinate", name, coordinates)
            elif name in self.independent[:k]:
                yield ("independent", k), f"{name} is listed twice"
        for name in self.guess:
            if name not in coordinates:
                yield ("guess", name), UnknownNameError("coordinate", name, coordinates)

    @property
    def frames(self) -> str:
        """Sentence on the placement of the frames, for the table of the geometry."""
        return "each placed in the frame of the body it is on where all coordinates are zero; m and rad"

    def build_table(self) -> tuple[tuple[str, ...], ...]:
        """Return the geometry as a table for people, with a header row first."""
        table: list[tuple[str, ...]] = [("body", "on", "joint", "axes", "at", "coordinates")]
        table += [body.build_row() for body in self.bodies]
        for k, section in enumerate(self.closures):
            number = section.length or section.ratio
            kind = f"{section.type} {number:g}" if number else section.type
            positions = "; ".join(_format_placement(compose_steps(frame)) for frame in section.at)
            name, bodies = section.name or f"loop_{k + 1}", " - ".join(section.bodies)
            table.append((name, bodies, f"closure: {kind}", "", positions, ""))
        return tuple(table)


def _format_placement(placement: FloatArray) -> str:
    """Return position, rotation axis and angle of a frame as text."""
    text = _format_numbers(placement[:3, 3])
    angle, axis = to_axis_angle(placement[:3, :3])
    return text if angle < _NO_TURN else f"{text}, turned {angle:.4g} about {_format_numbers(axis)}"


def _format_numbers(values: Sequence[float] | FloatArray) -> str:
    return " ".join(f"{value:.4g}" for value in np.where(np.abs(values) < _NO_TURN, 0.0, values))
