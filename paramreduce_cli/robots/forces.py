"""Force elements in a YAML file: springs and dampers between two points, bushings, tyres, and linear contacts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from paramreduce_cli.fields.names import Problem, UnknownNameError
from paramreduce_cli.fields.numbers import Number
from paramreduce_cli.fields.section import Name, Positive, Section
from paramreduce_cli.records import Drive, FloatArray, Kind, MotionBetween, MotionKind
from paramreduce_cli.robots.drives import ForceParameters, Table, Value, is_along_line
from paramreduce_cli.robots.placement import ONE_PLACE_OR_TWO, Placement, compose_steps

_AXES = ("x", "y", "z", "rx", "ry", "rz")
_AXLE = 1
"""Axis of a wheel's frame along which its axle lies."""


class ForceAlong(NamedTuple):
    """A force along one motion: its record, and its parameters."""

    drive: Drive
    values: Mapping[Kind, float]
    sliding: bool
    """Whether the motion is in m and not in rad."""


class Names(NamedTuple):
    """The indices of bodies and coordinates by name."""

    bodies: Mapping[str, int]
    """Bodies, and the base under ``base``."""
    coordinates: Sequence[str]
    slides: frozenset[str]
    """Names of the coordinates that slide."""


class ForceElement(Section, ABC):
    """A force element between bodies, or along coordinates."""

    @abstractmethod
    def build_forces(self, name: str, names: Names) -> list[ForceAlong]:
        """Return the forces that the element consists of, each along one motion."""

    @abstractmethod
    def list_unknown(self) -> list[str]:
        """Return the keys of the values that are still to be found."""

    def find_problems(self, bodies: Sequence[str], coordinates: Sequence[str]) -> Iterator[Problem]:
        """Yield contradictions with the mechanism, by the keys below the element.

        Args:
            bodies: Names of the bodies, and ``base``.
            coordinates: Names of the generalised coordinates.
        """
        for key, name in self._list_bodies():
            if name not in bodies:
                yield key, UnknownNameError("body", name, bodies)
        pair = [name for _, name in self._list_bodies()]
        if len(pair) == 2 and pair[0] == pair[1]:
            yield ("bodies",), f"acts between {pair[0]!r} and itself"

    def _list_bodies(self) -> list[tuple[tuple[str | int, ...], str]]:
        """Return the bodies that the element names, with the keys where they stand."""
        return []


class _BetweenBodies(Section):
    """The places on two bodies that a force element acts between."""

    bodies: Annotated[list[Name], Field(min_length=2, max_length=2)]
    """The two bodies, `base` for the base."""
    at: Annotated[list[Placement], Field(min_length=2, max_length=2), ONE_PLACE_OR_TWO]
    """Place on each of the two bodies: a point, the name of a point, or steps to a frame; one name for both if they meet there."""

    def _list_bodies(self) -> list[tuple[tuple[str | int, ...], str]]:
        """Return the two bodies with their keys."""
        return [(("bodies", k), name) for k, name in enumerate(self.bodies)]

    def _build_motion(self, kind: MotionKind, names: Names, axis: int = 0) -> MotionBetween:
        """Return a motion between the two places."""
        first, second = (names.bodies[name] for name in self.bodies)
        frames = (compose_steps(self.at[0]), compose_steps(self.at[1]))
        return MotionBetween(kind, (first, second), frames, axis)


class LineForce(ForceParameters, _BetweenBodies, ForceElement):
    """A spring, damper, friction or constant force along the line between two points; a positive force pulls them together."""

    type: Literal["line"]
    """`line`: along the line between two points."""

    def build_forces(self, name: str, names: Names) -> list[ForceAlong]:
        """Return the force along the line."""
        motion = self._build_motion("distance", names)
        drive = Drive(name, _make_no_weights(names), **self.get_characteristic(), between=motion)
        return [ForceAlong(drive, self.get_values(), True)]


class Bushing(_BetweenBodies, ForceElement):
    """A bushing: springs and dampers along and about the axes of the frame on the first body, for small rotations."""

    type: Literal["bushing"]
    """`bushing`: along and about three axes."""
    stiffness: Annotated[list[Value], Field(min_length=6, max_length=6)] | None = None
    """Stiffnesses along x, y, z, N/m, and about x, y, z, N m/rad; 0 for none."""
    viscous: Annotated[list[Value], Field(min_length=6, max_length=6)] | None = None
    """Dampings along x, y, z, N s/m, and about x, y, z, N m s/rad; 0 for none."""
    rest: Literal["static"] | None = None
    """static for preloads with which springs balance all other forces in the design position; without it the bushing is slack where both frames coincide."""

    @model_validator(mode="after")
    def _check_not_empty(self) -> Bushing:
        """Raise ValueError if the bushing has neither stiffness nor damping, or no known stiffness to be preloaded."""
        if self.rest == "static" and (
            not any(self.stiffness or ()) or "unknown" in (self.stiffness or ())
        ):
            raise ValueError("rest: static needs stiffnesses that are known")
        if not any((*(self.stiffness or ()), *(self.viscous or ()))):
            raise ValueError("is empty; give stiffness or viscous, six values each")
        return self

    def build_forces(self, name: str, names: Names) -> list[ForceAlong]:
        """Return the forces along and about the three axes, without those that are zero."""
        result = []
        for k, axis in enumerate(_AXES):
            given = {Kind.STIFFNESS: self.stiffness, Kind.VISCOUS: self.viscous}
            values = {
                kind: _get_number(some[k]) for kind, some in given.items() if some and some[k]
            }
            if values:
                motion = self._build_motion("shift" if k < 3 else "turn", names, k % 3)
                rest = np.nan if self.rest and values.get(Kind.STIFFNESS) else 0.0
                drive = Drive(f"{name}_{axis}", _make_no_weights(names), rest=rest, between=motion)
                result.append(ForceAlong(drive, values, k < 3))
        return result

    def list_unknown(self) -> list[str]:
        """Return the keys of the values that are still to be found."""
        return [key for key in ("stiffness", "viscous") if "unknown" in (getattr(self, key) or ())]


class Tyre(_BetweenBodies, ForceElement):
    """A tyre on a road: vertical spring and damper, and forces that go as side slip and slip."""

    type: Literal["tyre"]
    """`tyre`: between the road, whose frame has z upwards, and the body that carries the wheel, at the wheel's centre with y along its axle to the left."""
    radius: Positive
    """Radius without load, m: the vertical force is zero at this height of the centre above the road, unless `rest` is static."""
    rest: Literal["static"] | None = None
    """static for a preload with which springs balance all other forces in the design position; `radius` is then that of rolling alone."""
    spin: Name | None = None
    """Coordinate by which the wheel spins about its axle, positive where it rolls forward; needed for a longitudinal stiffness."""
    stiffness: Value | None = None
    """Vertical stiffness, N/m."""
    viscous: Value | None = None
    """Vertical damping, N s/m."""
    spring_table: Table | None = None
    """Points [height of the centre less `radius`, vertical force], m, N; it adds to a stiffness; [[-1, -2e5], [0, 0], [1, 0]] is a tyre that lifts off."""
    cornering: Value | None = None
    """Cornering stiffness: the lateral force per side slip, N."""
    longitudinal: Value | None = None
    """Longitudinal force per slip, N."""
    low_speed: Positive = 1.0
    """Speed v0 below which slips lose their meaning, m/s: they are slip velocities over sqrt(v^2 + v0^2)."""

    @model_validator(mode="after")
    def _check_values(self) -> Tyre:
        """Raise ValueError if the tyre has no force, or if slip cannot be computed."""
        keys = ("stiffness", "viscous", "spring_table", "cornering", "longitudinal")
        if all(getattr(self, key) is None for key in keys):
            raise ValueError(f"is empty; give one of {', '.join(keys)}")
        if self.rest == "static" and (
            self.stiffness in (None, 0, "unknown") or self.spring_table is not None
        ):
            raise ValueError("rest: static needs a stiffness that is known, and no spring_table")
        if self.longitudinal is not None and self.spin is None:
            raise ValueError("longitudinal needs spin, the coordinate by which the wheel spins")
        return self

    def build_forces(self, name: str, names: Names) -> list[ForceAlong]:
        """Return the vertical force, and those that slips cause."""
        vertical: dict[Kind, Any] = {
            Kind.VISCOUS: self.viscous,
            Kind.STIFFNESS: self.stiffness,
            Kind.SPRING_TABLE: None if self.spring_table is None else 1.0,
        }
        values = {kind: _get_number(value) for kind, value in vertical.items() if value is not None}
        result = []
        if values:
            table = None if self.spring_table is None else np.array(self.spring_table)
            motion = self._build_motion("shift", names, 2)
            rest = np.nan if self.rest == "static" else self.radius
            drive = Drive(
                name, _make_no_weights(names), rest=rest, spring_table=table, between=motion
            )
            result.append(ForceAlong(drive, values, True))
        kinds: tuple[tuple[MotionKind, Value | None], ...] = (
            ("sideslip", self.cornering),
            ("slip", self.longitudinal),
        )
        for kind, value in kinds:
            if value is not None:
                drive = Drive(
                    f"{name}_{kind}", _make_no_weights(names), between=self._build_slip(kind, names)
                )
                result.append(ForceAlong(drive, {Kind.CREEP: _get_number(value)}, True))
        return result

    def _build_slip(self, kind: MotionKind, names: Names) -> MotionBetween:
        """Return the motion of a slip."""
        plain = self._build_motion(kind, names)
        spin = -1 if self.spin is None else names.coordinates.index(self.spin)
        return MotionBetween(
            kind, plain.bodies, plain.frames, _AXLE, self.radius, spin, self.low_speed
        )

    def list_unknown(self) -> list[str]:
        """Return the keys of the values that are still to be found."""
        keys = ("stiffness", "viscous", "cornering", "longitudinal")
        return [key for key in keys if getattr(self, key) == "unknown"]

    def find_problems(self, bodies: Sequence[str], coordinates: Sequence[str]) -> Iterator[Problem]:
        """Yield contradictions with the mechanism, by the keys below the element."""
        yield from super().find_problems(bodies, coordinates)
        if self.spin is not None and self.spin not in coordinates:
            yield ("spin",), UnknownNameError("coordinate", self.spin, coordinates)


class Contact(ForceElement):
    """A linear contact: a force along a motion that goes as another sum of coordinates and speeds, such as the creep of a wheel on a rail."""

    type: Literal["contact"]
    """`contact`: creep times a creepage, along coordinates."""
    motion: Annotated[dict[str, Number], Field(min_length=1)]
    """Weights of the coordinates in the motion that the force acts along."""
    positions: dict[str, Number] = {}
    """Weights of coordinates in the creepage; 1 per its unit for a creepage without unit."""
    speeds: dict[str, Number] = {}
    """Weights of speeds of coordinates in the creepage; 1 over a speed for a creepage without unit."""
    creep: Value
    """Force per creepage, N m (N); it resists the motion where the creepage has the sign of the speed."""

    def build_forces(self, name: str, names: Names) -> list[ForceAlong]:
        """Return the force along the motion."""
        creepage = np.stack([_make_weights(some, names) for some in (self.positions, self.speeds)])
        drive = Drive(name, _make_weights(self.motion, names), creepage=creepage)
        sliding = is_along_line(self.motion, names.slides)
        return [ForceAlong(drive, {Kind.CREEP: _get_number(self.creep)}, sliding)]

    def list_unknown(self) -> list[str]:
        """Return the keys of the values that are still to be found."""
        return ["creep"] if self.creep == "unknown" else []

    def find_problems(self, bodies: Sequence[str], coordinates: Sequence[str]) -> Iterator[Problem]:
        """Yield unknown coordinates, by the keys below the element."""
        for key in ("motion", "positions", "speeds"):
            for name in getattr(self, key):
                if name not in coordinates:
                    yield (key, name), UnknownNameError("coordinate", name, coordinates)
        if not self.positions and not self.speeds:
            yield (), "has no creepage; give positions or speeds"


ForceSection = Annotated[LineForce | Bushing | Tyre | Contact, Field(discriminator="type")]
"""A force element of any type."""


def _get_number(value: Any) -> float:
    """Return a value as a number, zero if it is unknown."""
    return 0.0 if value == "unknown" else float(value)


def _make_no_weights(names: Names) -> FloatArray:
    """Return zeros for all coordinates, (n_q,)."""
    return np.zeros(len(names.coordinates))


def _make_weights(given: Mapping[str, float], names: Names) -> FloatArray:
    """Return the weights of all coordinates, (n_q,), from those of some by name."""
    weights = _make_no_weights(names)
    for name, weight in given.items():
        weights[names.coordinates.index(name)] = weight
    return weights
