"""A robot as its YAML describes it: the mechanism, its parameters, the size of its torques."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from paramreduce_cli.fields.numbers import Number
from paramreduce_cli.fields.section import (
    NAME,
    Name,
    PositivePerJoint,
    Section,
    Triple,
    expand_per_joint,
)
from paramreduce_cli.records import INERTIAL, BoolArray, FloatArray, Mechanism, Parameter
from paramreduce_cli.robots.bodies import BodiesDescription
from paramreduce_cli.robots.dh import DHDescription
from paramreduce_cli.robots.drives import DriveSection, by_drive
from paramreduce_cli.robots.inertia import BodyParameters
from paramreduce_cli.robots.payloads import PayloadSection
from paramreduce_cli.robots.tree import TreeDescription


class Description(Section):
    """The mechanism on a fixed base: a Denavit-Hartenberg table, or bodies with joints and loops."""

    dh: DHDescription | None = None
    """Denavit-Hartenberg table of an open tree; or give tree."""
    tree: TreeDescription | None = None
    """Bodies, joints and loop closures; or give dh."""
    gravity: Triple = [0.0, 0.0, -9.81]
    """Acceleration of gravity in the base frame, m/s^2."""

    @model_validator(mode="after")
    def _one_way_only(self) -> Description:
        if len(self._given()) != 1:
            raise ValueError("give dh or tree, one of them")
        return self

    def _given(self) -> dict[str, BodiesDescription]:
        values = ((name, getattr(self, name)) for name in type(self).model_fields)
        return {name: value for name, value in values if isinstance(value, BodiesDescription)}

    @property
    def way(self) -> str:
        """Key of the way in which the bodies are described."""
        return next(iter(self._given()))

    @property
    def bodies(self) -> BodiesDescription:
        """The bodies, in the way they are described."""
        return self._given()[self.way]


class Robot(Section):
    """What a robot is, whatever is done with it."""

    robot: Annotated[str, Field(pattern=NAME)]
    """Name of the robot; results go to results/ROBOT."""
    constants: dict[str, Number] = {}
    """Named numbers, such as lengths in m, that all other numbers may be written with; each may use those above it."""
    description: Description
    """The mechanism."""
    parameter_sets: Annotated[dict[str, dict[str, BodyParameters]], Field(min_length=1)]
    """Named sets of standard parameters: for each set, for each body."""
    parameters: str | None = None
    """Name of the set that is used; the first one if left out."""
    payloads: dict[Name, PayloadSection] = {}
    """What bodies carry, by name; its parameters are called after it."""
    drives: dict[Name, DriveSection] = {}
    """Rotors, friction and springs by coordinate, by a name of one's own with a motion, or under `all` for every driven coordinate."""
    nominal_torque: PositivePerJoint | Literal["standard-deviation"] = "standard-deviation"
    """Characteristic torques, one for all joints or a list, N m (N if prismatic); or their standard deviation over the estimation set."""

    unmeasured: list[Name] = []
    """Independent coordinates whose torques are not measured, such as those of a floating base: base parameters, fits and errors leave them out."""

    @property
    def n_dof(self) -> int:
        """Number of independent coordinates."""
        return len(self.description.bodies.independent_names())

    def mechanism(self) -> Mechanism:
        """The mechanism as it is described; loops are not assembled yet."""
        bodies = self.description.bodies
        coordinates, rigid = bodies.generalised_names(), bodies.rigid_bodies()
        index = {body.name: k for k, body in enumerate(rigid)}
        return Mechanism(
            robot=self.robot,
            bodies=rigid,
            parameters=self.dynamic_parameters(),
            gravity=np.array(self.description.gravity, dtype=float),
            lengths=bodies.lengths(),
            table=bodies.table(),
            loops=bodies.loops(),
            payloads=tuple(s.payload(name, index) for name, s in self.payloads.items()),
            drives=tuple(s.drive(name, coordinates) for name, s in self.each_drive().items()),
            frames=bodies.frames,
        )

    def stretched(self, stretch: Callable[[float], float]) -> Robot:
        """The same structure with other lengths, as far as these have names."""
        old = self.description
        changed = old.model_copy(update={old.way: old.bodies.stretched(stretch)})
        return self.model_copy(update={"description": changed})

    def each_drive(self) -> dict[str, DriveSection]:
        """All drives by name."""
        return by_drive(self.drives, self.description.bodies.driven_names())

    def dynamic_parameters(self) -> tuple[Parameter, ...]:
        """All parameters: body by body, then payload by payload, then drive by drive."""
        bodies = self.description.bodies
        rigid = [*bodies.inertial_names(), *self.payloads]
        slides = {body.coordinate for body in bodies.rigid_bodies() if body.joint == "prismatic"}
        return (
            *(Parameter(kind, name) for name in rigid for kind in INERTIAL),
            *(
                Parameter(kind, name, slides.issuperset(section.motion or [name]))
                for name, section in self.each_drive().items()
                for kind in section.effects()
            ),
        )

    def body_parameters(self) -> dict[str, BodyParameters]:
        """The chosen set by body, then payloads."""
        chosen = self.parameter_sets[self.parameters or next(iter(self.parameter_sets))]
        names = self.description.bodies.inertial_names()
        return {name: chosen.get(name, BodyParameters()) for name in names} | self.payloads

    def parameter_values(self) -> FloatArray:
        """Values of all parameters, (n_parameters,), SI."""
        rigid = [body.values() for body in self.body_parameters().values()]
        driven = [drive.effects() for drive in self.each_drive().values()]
        return np.array([value for values in rigid + driven for value in values.values()])

    def measured(self) -> BoolArray:
        """Which independent coordinates have torques that are measured, (n_dof,)."""
        names = self.description.bodies.independent_names()
        return np.array([name not in self.unmeasured for name in names])

    def given_nominal_torque(self) -> FloatArray | None:
        """The characteristic torques where they are given, (n_dof,), N m or N."""
        if self.nominal_torque == "standard-deviation":
            return None
        return expand_per_joint(self.nominal_torque, self.n_dof)
