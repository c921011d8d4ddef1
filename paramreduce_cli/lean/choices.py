"""What can be chosen at every joint without changing what a model computes."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from enum import StrEnum

from paramreduce_cli.lean.motion import Diagonal
from paramreduce_cli.lean.wrench import Gauge


class Place(StrEnum):
    """Where a part of a body's inertia is met by the motion."""

    OWN = "own"
    """In the body's frame, whose motion is turned by the joint's angle."""
    REST = "rest"
    """In the joint's frame at rest, to which the part is turned."""
    BEFORE = "before"
    """With the body before, to whose inertia it is added; the joint's own motion is met on the way."""


@dataclass(frozen=True)
class Choice:
    """Of one joint."""

    aligned: bool = False
    """Whether a parallel axis adds its angle to that of the joint before."""
    gauge: Gauge = Gauge.NONE
    mass: Place = Place.BEFORE
    axial: Place = Place.BEFORE
    """First moment along the axis."""
    radial: Place = Place.OWN
    """First moments across the axis."""
    polar: Place = Place.OWN
    """Izz"""
    tilt: Place = Place.OWN
    """Ixz, Iyz"""
    plane: Place = Place.OWN
    """Ixx, Ixy, Iyy"""
    diagonal: Diagonal = Diagonal.SQUARES
    doubled: bool = False
    reach_turned: bool = False
    """Whether the place of an aligned joint is turned, not its acceleration."""
    projected: bool = False
    """Whether wrenches are projected on all axes before from here, not handed on from body to body."""

    @property
    def places(self) -> tuple[Place, ...]:
        """All that are chosen."""
        return (self.mass, self.axial, self.radial, self.polar, self.tilt, self.plane)


PLACED = ("mass", "axial", "radial", "polar", "tilt", "plane")
OPTIONS: dict[str, tuple] = {
    "aligned": (False, True),
    "gauge": tuple(Gauge),
    **{name: tuple(Place) for name in PLACED},
    "diagonal": tuple(Diagonal),
    "doubled": (False, True),
    "reach_turned": (False, True),
    "projected": (False, True),
}


def alternatives(choice: Choice) -> list[Choice]:
    """Choices that differ in one thing, or have several parts in one other place together."""
    single = [
        replace(choice, **{name: value})
        for name, values in OPTIONS.items()
        for value in values
        if value != getattr(choice, name)
    ]
    groups = (("tilt", "plane"), ("polar", "tilt", "plane"), ("radial", "polar", "tilt", "plane"))
    joint = [
        replace(choice, **dict.fromkeys(group, place)) for group in groups for place in Place
    ]
    return single + [c for c in joint if c != choice]


def to_data(choice: Choice) -> dict[str, str | bool]:
    """As a mapping of plain values."""
    return {f.name: getattr(choice, f.name) for f in fields(choice)}
