"""Denavit-Hartenberg descriptions: modified as in [Khalil2002] and [Craig2005], and standard."""

from collections.abc import Callable
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field

from paramreduce_cli.fields.numbers import Number
from paramreduce_cli.fields.section import Name, Section
from paramreduce_cli.records import BASE, Body, FloatArray, Length
from paramreduce_cli.robots.bodies import BodiesDescription
from paramreduce_cli.robots.frames import rotation_x, rotation_z, translation, written_angle


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

    def frames(self, convention: str) -> tuple[FloatArray, FloatArray]:
        """From the parent to the joint at rest, and from the moved joint to the body, (4, 4) each."""
        branch = rotation_z(self.gamma) @ translation(0.0, 0.0, self.b)
        turn, shift = rotation_x(self.alpha), translation(self.a, 0.0, 0.0)
        if convention == "modified":
            return branch @ turn @ shift @ self._still_part(), np.eye(4)
        return branch @ self._still_part(), shift @ turn

    def _still_part(self) -> FloatArray:
        """Of theta and d the one that the coordinate does not move; along z the two commute."""
        if self.type == "revolute":
            return translation(0.0, 0.0, self.d)
        return rotation_z(self.theta)

    @property
    def offset(self) -> float:
        """Added to the coordinate, rad or m."""
        return written_angle(self.theta) if self.type == "revolute" else self.d


class DHDescription(BodiesDescription):
    """A tree of bodies in Denavit-Hartenberg parameters."""

    ROWS: ClassVar[str] = "joints"

    convention: Literal["modified", "standard"] = "modified"
    """`modified` as in Khalil and Craig: frame i on the axis of joint i; `standard`: on the axis of joint i + 1."""
    joints: Annotated[list[DHJoint], Field(min_length=1)]
    """One row per body, parents above their children."""

    def body_names(self) -> list[str]:
        """Names of all bodies, in order."""
        return [joint.name or str(k + 1) for k, joint in enumerate(self.joints)]

    def parents(self) -> list[str | None]:
        """Names of the parents as they are given, None where the row above is meant."""
        return [joint.parent for joint in self.joints]

    def generalised_names(self) -> list[str]:
        """Names of all coordinates."""
        return [f"z_{name}" for name in self.body_names()]

    def rigid_bodies(self) -> tuple[Body, ...]:
        """The bodies with their joints."""
        names = self.body_names()
        index = {"base": BASE} | {name: k for k, name in enumerate(names)}
        bodies = []
        for k, (name, joint) in enumerate(zip(names, self.joints, strict=True)):
            parent = k - 1 if joint.parent is None else index[joint.parent]
            frames = joint.frames(self.convention)
            bodies.append(Body(name, parent, joint.type, *frames, f"z_{name}", joint.offset))
        return tuple(bodies)

    def lengths(self) -> tuple[Length, ...]:
        """Lengths of the geometry that are not zero."""
        lengths = (
            Length(key, name, float(getattr(joint, key)))
            for name, joint in zip(self.body_names(), self.joints, strict=True)
            for key in ("a", "d", "b")
        )
        return tuple(length for length in lengths if length.value != 0.0)

    def stretched(self, stretch: Callable[[float], float]) -> Self:
        """The same structure with other lengths, to see what follows from the structure alone."""
        joints = [
            joint.model_copy(
                update={"a": stretch(joint.a), "d": stretch(joint.d), "b": stretch(joint.b)}
            )
            for joint in self.joints
        ]
        return self.model_copy(update={"joints": joints})

    @property
    def frames(self) -> str:
        """Where the table says that the frames of the bodies are, for people."""
        axis = "of joint i" if self.convention == "modified" else "of the joint after body i"
        return (
            f"{self.convention} Denavit-Hartenberg, z of frame i along the axis {axis}; m and rad"
        )

    def table(self) -> tuple[tuple[str, ...], ...]:
        """The geometry for people, a header row first."""
        branching = any(joint.gamma or joint.b for joint in self.joints)
        header = ["body", "parent", "joint", *(["gamma", "b"] if branching else [])]
        table = [(*header, "a", "alpha", "d", "theta")]
        above = "base"
        for name, joint in zip(self.body_names(), self.joints, strict=True):
            angle, length = _angle_text(joint.theta), f"{joint.d:g}"
            if joint.type == "revolute":
                angle = _with_coordinate(joint.theta, angle, name)
            else:
                length = _with_coordinate(joint.d, length, name)
            cells = [name, joint.parent or above, joint.type]
            if branching:
                cells += [_angle_text(joint.gamma), f"{joint.b:g}"]
            table.append((*cells, f"{joint.a:g}", _angle_text(joint.alpha), length, angle))
            above = name
        return tuple(table)


def _with_coordinate(offset: float, text: str, name: str) -> str:
    return f"z_{name}" if offset == 0 else f"z_{name} + {text}"


def _angle_text(angle: float) -> str:
    for denominator in (1, 2, 3, 4, 6):
        multiple = angle * denominator / np.pi
        if abs(multiple - round(multiple)) < 1e-12:
            top = round(multiple)
            if top == 0:
                return "0"
            sign, top = ("-" if top < 0 else ""), abs(top)
            return (
                f"{sign}{'' if top == 1 else top}pi{'' if denominator == 1 else f'/{denominator}'}"
            )
    return f"{angle:g}"
