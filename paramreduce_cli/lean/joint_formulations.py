"""What can be chosen at every joint without changing what a model computes."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from enum import StrEnum
from typing import Any

from paramreduce_cli.lean.frame_motion import AngularAcceleration, Diagonal
from paramreduce_cli.lean.joint_frames import Joint
from paramreduce_cli.lean.wrench import Gauge
from paramreduce_cli.records import BASE


class InertiaPlace(StrEnum):
    """A recursion step at which a part of a body's inertia is multiplied with the motion."""

    OWN = "own"
    """Multiplied in the body's frame, whose motion is rotated by the joint's angle."""
    REST = "rest"
    """Multiplied in the joint's frame at rest, to which the part is rotated."""
    BEFORE = "before"
    """Added to the inertia of the parent body; the joint's own motion is added separately."""


@dataclass(frozen=True)
class JointFormulation:
    """A choice of the equivalent formulas at one joint."""

    aligned: bool = False
    """Whether a parallel axis adds its angle to that of the joint before."""
    gauge: Gauge = Gauge.NONE
    mass: InertiaPlace = InertiaPlace.BEFORE
    axial: InertiaPlace = InertiaPlace.BEFORE
    """First moment along the axis."""
    radial: InertiaPlace = InertiaPlace.OWN
    """First moments across the axis."""
    polar: InertiaPlace = InertiaPlace.OWN
    """Izz"""
    tilt: InertiaPlace = InertiaPlace.OWN
    """Ixz, Iyz"""
    plane: InertiaPlace = InertiaPlace.OWN
    """Ixx, Ixy, Iyy"""
    diagonal: Diagonal = Diagonal.SQUARES
    rates: AngularAcceleration = AngularAcceleration.COLUMN
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
    **{name: tuple(InertiaPlace) for name in _PLACED},
    "diagonal": tuple(Diagonal),
    "rates": tuple(AngularAcceleration),
    "reach_turned": (False, True),
    "projected": (False, True),
}
"""All values of every choice."""


def list_alternatives(choice: JointFormulation, joint: Joint) -> list[JointFormulation]:
    """List the formulations of a joint that differ in one choice, or in the recursion step of several inertia parts.

    Projections of wrenches are varied by :func:`list_distant_alternatives` instead.
    """
    names = _list_effective_fields(choice, joint)
    steps = tuple(InertiaPlace) if joint.revolute else (InertiaPlace.OWN, InertiaPlace.BEFORE)
    single = [
        replace(choice, **{name: value})  # type: ignore[arg-type]
        for name in names
        for value in (steps if name in _PLACED else OPTIONS[name])
    ]
    together = [
        replace(choice, **dict.fromkeys(group, place))  # type: ignore[arg-type]
        for group in _TOGETHER
        for place in steps
    ]
    return [c for c in dict.fromkeys(single + together) if c != choice]


def list_distant_alternatives(choice: JointFormulation, joint: Joint) -> list[JointFormulation]:
    """List the alternatives that change all wrenches that pass through a joint from the bodies beyond it."""
    names = _list_alignment_fields(choice, joint) + ["projected"] * (joint.parent != BASE)
    return [replace(choice, **{name: not getattr(choice, name)}) for name in names]  # type: ignore[arg-type]


def _list_effective_fields(choice: JointFormulation, joint: Joint) -> list[str]:
    """Return the fields of a choice that make a difference at a joint."""
    names = list(_PLACED)
    if joint.revolute:
        names += ["gauge", "diagonal", "rates"]
    return names + _list_alignment_fields(choice, joint)


def _list_alignment_fields(choice: JointFormulation, joint: Joint) -> list[str]:
    return ["aligned"] * joint.parallel + ["reach_turned"] * (joint.parallel and choice.aligned)


def to_data(choice: JointFormulation) -> dict[str, str | bool]:
    """Return a choice as plain values."""
    return {
        f.name: value if isinstance(value := getattr(choice, f.name), bool) else str(value)
        for f in fields(choice)
    }


def from_data(data: Mapping[str, str | bool]) -> JointFormulation:
    """Return the formulation of a joint from plain values, as files hold it."""
    kinds = {
        "gauge": Gauge,
        "diagonal": Diagonal,
        "rates": AngularAcceleration,
        **dict.fromkeys(_PLACED, InertiaPlace),
    }
    return JointFormulation(
        **{name: kinds[name](value) if name in kinds else value for name, value in data.items()}  # type: ignore[arg-type]
    )
