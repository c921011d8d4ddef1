"""Denavit-Hartenberg descriptions: modified as in [Khalil2002] and [Craig2005], and standard."""

from collections.abc import Callable
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field

from paramreduce_cli.fields.numbers import Number
from paramreduce_cli.fields.section import Name, Section
from paramreduce_cli.records import BASE, Body, FloatArray, Length
from paramreduce_cli.robots.bodies import BodiesDescription
from paramreduce_cli.robots.frames import rotate_x, rotate_z, round_to_right_angles, translate


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

    def compute_frames(self, convention: str) -> tuple[FloatArray, FloatArray]:
        """Return the transforms from the parent to the joint at rest, and from the moved joint to the body, (4, 4)
        each.
        """
        branch = rotate_z(self.gamma) @ translate(0.0, 0.0, self.b)
        rotation, shift = rotate_x(self.alpha), translate(self.a, 0.0, 0.0)
        if convention == "modified":
            return branch @ rotation @ shift @ self._compute_constant_part(), np.eye(4)
        return branch @ self._compute_constant_part(), shift @ rotation

    def _compute_constant_part(self) -> FloatArray:
        """Return the transform of d or theta, whichever the coordinate does not change; both act along z, so the order
        does not matter.
        """
        if self.type == "revolute":
            return translate(0.0, 0.0, self.d)
        return rotate_z(self.theta)

    @property
    def offset(self) -> float:
        """Added to the coordinate, rad or m."""
        return round_to_right_angles(self.theta) if self.type == "revolute" else self.d


class DHDescription(BodiesDescription):
    """A tree of bodies in Denavit-Hartenberg parameters."""

    ROWS: ClassVar[str] = "joints"

    convention: Literal["modified", "standard"] = "modified"
    """`modified` as in Khalil and Craig: frame i on the axis of joint i; `standard`: on the axis of joint i + 1."""
    joints: Annotated[list[DHJoint], Field(min_length=1)]
    """One row per body, parents above their children."""

    def list_body_names(self) -> list[str]:
        """Return the names of all bodies, in order."""
        return [joint.name or str(k + 1) for k, joint in enumerate(self.joints)]

    def list_parents(self) -> list[str | None]:
        """Return the names of the parents as they are given; None where the body of the row above is meant."""
        return [joint.parent for joint in self.joints]

    def list_coordinates(self) -> list[str]:
        """Return the names of all coordinates."""
        return [f"z_{name}" for name in self.list_body_names()]

    def build_bodies(self) -> tuple[Body, ...]:
        """Return the bodies with their joints."""
        names = self.list_body_names()
        index = {"base": BASE} | {name: k for k, name in enumerate(names)}
        bodies = []
        for k, (name, joint) in enumerate(zip(names, self.joints, strict=True)):
            parent = k - 1 if joint.parent is None else index[joint.parent]
            frames = joint.compute_frames(self.convention)
            bodies.append(Body(name, parent, joint.type, *frames, f"z_{name}", joint.offset))
        return tuple(bodies)

    def list_lengths(self) -> tuple[Length, ...]:
        """Return the lengths of the geometry that are not zero."""
        lengths = (
            Length(key, name, float(getattr(joint, key)))
            for name, joint in zip(self.list_body_names(), self.joints, strict=True)
            for key in ("a", "d", "b")
        )
        return tuple(length for length in lengths if length.value != 0.0)

    def stretch(self, stretch: Callable[[float], float]) -> Self:
        """Return the same structure with other lengths, which shows what follows from the structure alone."""
        joints = [
            joint.model_copy(
                update={"a": stretch(joint.a), "d": stretch(joint.d), "b": stretch(joint.b)}
            )
            for joint in self.joints
        ]
        return self.model_copy(update={"joints": joints})

    @property
    def frames(self) -> str:
        """Sentence on the convention of the frames, for the table of the geometry."""
        axis = "of joint i" if self.convention == "modified" else "of the joint after body i"
        return (
            f"{self.convention} Denavit-Hartenberg, z of frame i along the axis {axis}; m and rad"
        )

    def build_table(self) -> tuple[tuple[str, ...], ...]:
        """Return the geometry as a table for people, with a header row first."""
        branching = any(joint.gamma or joint.b for joint in self.joints)
        header = ["body", "parent", "joint", *(["gamma", "b"] if branching else [])]
        table = [(*header, "a", "alpha", "d", "theta")]
        above = "base"
        for name, joint in zip(self.list_body_names(), self.joints, strict=True):
            angle, length = _format_angle(joint.theta), f"{joint.d:g}"
            if joint.type == "revolute":
                angle = _add_coordinate(joint.theta, angle, name)
            else:
                length = _add_coordinate(joint.d, length, name)
            cells = [name, joint.parent or above, joint.type]
            if branching:
                cells += [_format_angle(joint.gamma), f"{joint.b:g}"]
            table.append((*cells, f"{joint.a:g}", _format_angle(joint.alpha), length, angle))
            above = name
        return tuple(table)


def _add_coordinate(offset: float, text: str, name: str) -> str:
    """Return the text of an offset plus the coordinate of a joint."""
    return f"z_{name}" if offset == 0 else f"z_{name} + {text}"


def _format_angle(angle: float) -> str:
    """Return an angle as a multiple of pi, pi/2, pi/3, pi/4 or pi/6 if it is one, else with six significant digits."""
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
