"""What can be chosen at every joint without changing what a model computes."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from enum import StrEnum
from typing import Any

from paramreduce_cli.lean.motion import Diagonal, Rates
from paramreduce_cli.lean.tree import Joint
from paramreduce_cli.lean.wrench import Gauge
from paramreduce_cli.records import BASE


class Place(StrEnum):
    """Where a part of a body's inertia is met by the motion."""

    OWN = "own"
    """In the body's frame, whose motion is turned by the joint's angle."""
    REST = "rest"
    """In the joint's frame at rest, to which the part is turned."""
    BEFORE = "before"
    """With the body before, to whose inertia it is added; the joint's own motion is met on the way."""


@dataclass(frozen=True)
class JointFormulation:
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
    rates: Rates = Rates.COLUMN
    reach_turned: bool = False
    """Whether the place of an aligned joint is turned, not its acceleration."""
    projected: bool = False
    """Whether wrenches are projected on all axes before from here, not handed on from body to body."""


_PLACED = ("mass", "axial", "radial", "polar", "tilt", "plane")
_TOGETHER = (("tilt", "plane"), ("polar", "tilt", "plane"), ("radial", "polar", "tilt", "plane"))
"""Parts that are also moved to another place at once: one by one it may not pay."""

OPTIONS: dict[str, tuple[Any, ...]] = {
    "aligned": (False, True),
    "gauge": tuple(Gauge),
    **{name: tuple(Place) for name in _PLACED},
    "diagonal": tuple(Diagonal),
    "rates": tuple(Rates),
    "reach_turned": (False, True),
    "projected": (False, True),
}
"""All values of every choice."""


def alternatives(choice: JointFormulation, joint: Joint) -> list[JointFormulation]:
    """What else may be chosen at a joint: one thing differs, or several parts are in one other place.

    Whether wrenches are projected is for :func:`far_reaching` alone.
    """
    names = _effective(choice, joint)
    places = tuple(Place) if joint.revolute else (Place.OWN, Place.BEFORE)
    single = [
        replace(choice, **{name: value})  # type: ignore[arg-type]
        for name in names
        for value in (places if name in _PLACED else OPTIONS[name])
    ]
    together = [
        replace(choice, **dict.fromkeys(group, place))  # type: ignore[arg-type]
        for group in _TOGETHER
        for place in places
    ]
    return [c for c in dict.fromkeys(single + together) if c != choice]


def far_reaching(choice: JointFormulation, joint: Joint) -> list[JointFormulation]:
    """Alternatives that matter to every wrench that is handed on past a joint, from however far."""
    names = _aligning(choice, joint) + ["projected"] * (joint.parent != BASE)
    return [replace(choice, **{name: not getattr(choice, name)}) for name in names]  # type: ignore[arg-type]


def _effective(choice: JointFormulation, joint: Joint) -> list[str]:
    """What makes a difference at a joint."""
    names = list(_PLACED)
    if joint.revolute:
        names += ["gauge", "diagonal", "rates"]
    return names + _aligning(choice, joint)


def _aligning(choice: JointFormulation, joint: Joint) -> list[str]:
    return ["aligned"] * joint.parallel + ["reach_turned"] * (joint.parallel and choice.aligned)


def to_data(choice: JointFormulation) -> dict[str, str | bool]:
    """As plain values."""
    return {
        f.name: value if isinstance(value := getattr(choice, f.name), bool) else str(value)
        for f in fields(choice)
    }


def from_data(data: Mapping[str, str | bool]) -> JointFormulation:
    """From plain values."""
    kinds = {"gauge": Gauge, "diagonal": Diagonal, "rates": Rates, **dict.fromkeys(_PLACED, Place)}
    return JointFormulation(
        **{name: kinds[name](value) if name in kinds else value for name, value in data.items()}  # type: ignore[arg-type]
    )
