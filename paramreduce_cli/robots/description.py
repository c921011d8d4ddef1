"""The robot that a YAML file describes: mechanism, parameters, and sizes of torques."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from paramreduce_cli.fields.numbers import Number
from paramreduce_cli.fields.section import (
    NAME,
    Name,
    PositivePerJoint,
    Section,
    Triple,
    expand_per_joint,
)
from paramreduce_cli.records import (
    BASE,
    INERTIAL,
    BoolArray,
    FloatArray,
    FrictionSearch,
    Kind,
    Mechanism,
    Parameter,
)
from paramreduce_cli.robots.bodies import BodiesDescription
from paramreduce_cli.robots.dh import DHDescription
from paramreduce_cli.robots.drives import DriveSection, merge_drives
from paramreduce_cli.robots.forces import ForceAlong, ForceSection, Names
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
    def _check_alternatives(self) -> Description:
        """Raise ValueError unless either dh or tree is given."""
        if len(self._list_given()) != 1:
            raise ValueError("give dh or tree, one of them")
        return self

    def _list_given(self) -> dict[str, BodiesDescription]:
        """Return the ways of description that the section uses, by name."""
        values = ((name, getattr(self, name)) for name in type(self).model_fields)
        return {name: value for name, value in values if isinstance(value, BodiesDescription)}

    @property
    def kind(self) -> str:
        """Key of the description that is given: dh or tree."""
        return next(iter(self._list_given()))

    @property
    def bodies(self) -> BodiesDescription:
        """Bodies, as the way of description gives them."""
        return self._list_given()[self.kind]


class SubsystemSection(Section):
    """A part of the mechanism that is written once and used several times; its keys are those of the config that they are copied to."""

    points: dict[Name, Any] = {}
    """Named points, as under description.tree.points."""
    bodies: list[dict[str, Any]] = []
    """Bodies, as under description.tree.bodies; parents may be bodies of the config."""
    closures: list[dict[str, Any]] = []
    """Closures of loops, as under description.tree.closures."""
    independent: list[Name] = []
    """Coordinates that are actuated, as under description.tree.independent."""
    guess: dict[Name, Any] = {}
    """Values of coordinates near a closed assembly, as under description.tree.guess."""
    parameters: dict[Name, Any] = {}
    """Standard parameters of the bodies, as under parameter_sets.NAME."""
    drives: dict[Name, Any] = {}
    """Rotors, friction and springs, as under drives."""
    forces: dict[Name, Any] = {}
    """Force elements, as under forces."""


class UseSection(Section):
    """A use of a subsystem."""

    subsystem: Name
    """Name of the subsystem."""
    suffix: Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]*$")] = ""
    """Text that is added to the names of all bodies, coordinates, points, closures, drives and forces of the subsystem."""
    shift: Annotated[list[Number], Field(min_length=3, max_length=3)] | None = None
    """Vector that the subsystem's named points are moved by, before they are mirrored, m."""
    names: dict[Name, Name] = {}
    """Names of this use for bodies and coordinates outside the subsystem, such as {frame: frame_2}."""
    mirror: Literal["x", "y", "z"] | None = None
    """Axis of the base whose direction is reversed in this use: y makes the right side of a vehicle of the left."""


class Robot(Section):
    """The part of a config that describes the robot, whatever is done with it."""

    robot: Annotated[str, Field(pattern=NAME)]
    """Name of the robot; results go to results/ROBOT."""
    constants: dict[str, Number] = {}
    """Named numbers, such as lengths in m, that all other numbers may be written with; each may use those above it."""
    subsystems: dict[Name, SubsystemSection] = {}
    """Parts of the mechanism that are used several times."""
    uses: list[UseSection] = []
    """Uses of subsystems: with every use their bodies, closures, drives and forces are added under names with a suffix."""
    description: Description
    """The mechanism."""
    parameter_sets: Annotated[dict[str, dict[str, BodyParameters]], Field(min_length=1)]
    """Named sets of standard parameters: for each set, for each body."""
    parameters: str | None = None
    """Name of the set that is used; the first one if left out."""
    payloads: dict[Name, PayloadSection] = {}
    """Payloads of the bodies, by name; the parameters of a payload have its name."""
    drives: dict[Name, DriveSection] = {}
    """Rotors, friction and springs by coordinate, by a name of one's own with a motion, or under `all` for every driven coordinate."""
    forces: dict[Name, ForceSection] = {}
    """Springs, dampers, bushings, tyres and contacts between bodies, by name; their parameters have this name."""
    nominal_torque: PositivePerJoint | Literal["standard-deviation"] = "standard-deviation"
    """Characteristic torques, one for all joints or a list, N m (N if prismatic); or their standard deviation over the estimation set."""

    unmeasured: list[Name] = []
    """Independent coordinates whose torques are not measured, such as those of a floating base: base parameters, fits and errors leave them out."""

    _bodies: tuple[float, ...] = PrivateAttr(())
    """Parameters of the bodies and payloads that were found with the friction, SI; empty without that."""

    @property
    def n_dof(self) -> int:
        """Number of independent coordinates."""
        return len(self.description.bodies.list_independent_coordinates())

    def __repr__(self) -> str:
        return f"{type(self).__name__}(robot={self.robot!r}, n_dof={self.n_dof})"

    def build_mechanism(self) -> Mechanism:
        """Return the mechanism as it is described; loops are not assembled yet."""
        bodies, parameters = self.description.bodies, self.list_parameters()
        coordinates, rigid = bodies.list_coordinates(), bodies.build_bodies()
        index = {body.name: k for k, body in enumerate(rigid)}
        return Mechanism(
            robot=self.robot,
            bodies=rigid,
            parameters=parameters,
            gravity=np.array(self.description.gravity, dtype=float),
            lengths=bodies.list_lengths(),
            table=bodies.build_table(),
            loops=bodies.build_loops(),
            payloads=tuple(s.build_payload(name, index) for name, s in self.payloads.items()),
            drives=(
                *(s.build_drive(name, coordinates) for name, s in self.list_drives().items()),
                *(force.drive for force in self.list_forces()),
            ),
            frames=bodies.frames,
            nominal=self._get_nominal(parameters),
        )

    def _get_nominal(self, parameters: Sequence[Parameter]) -> FloatArray | None:
        """Return the nominal parameters if friction depends on the load: those found with the friction, or the robot's."""
        if all(parameter.kind is not Kind.LOAD for parameter in parameters):
            return None
        values = self.get_values()
        values[: len(self._bodies)] = self._bodies
        return values

    def stretch(self, stretch: Callable[[float], float]) -> Robot:
        """Return the robot with other lengths, as far as lengths have names."""
        old = self.description
        changed = old.model_copy(update={old.kind: old.bodies.stretch(stretch)})
        return self.model_copy(update={"description": changed})

    def list_drives(self) -> dict[str, DriveSection]:
        """Return all drives by name."""
        return merge_drives(self.drives, self.description.bodies.list_driven_coordinates())

    def make_names(self) -> Names:
        """Return the indices of bodies and coordinates by name."""
        bodies = self.description.bodies
        rigid = bodies.build_bodies()
        index = {"base": BASE} | {body.name: k for k, body in enumerate(rigid)}
        slides = frozenset(body.coordinate for body in rigid if body.joint == "prismatic")
        return Names(index, bodies.list_coordinates(), slides)

    def list_forces(self) -> list[ForceAlong]:
        """Return the forces of all force elements, each along one motion."""
        names = self.make_names()
        return [
            force
            for name, section in self.forces.items()
            for force in section.build_forces(name, names)
        ]

    @property
    def automatic_friction(self) -> list[str]:
        """Names of the drives whose friction a log decides."""
        return [name for name, drive in self.list_drives().items() if drive.friction == "auto"]

    def apply_friction(self, search: FrictionSearch) -> Robot:
        """Return the robot with the friction that was found for some of its drives."""
        drives = self.list_drives()
        for k, name in enumerate(search.drives):
            drives[name] = drives[name].apply_friction(search, k)
        result = self.model_copy(update={"drives": drives})
        result._bodies = tuple(search.bodies.tolist())
        return result

    def list_parameters(self) -> tuple[Parameter, ...]:
        """Return all parameters: body by body, then payload by payload, then drive by drive."""
        bodies = self.description.bodies
        rigid = [*bodies.list_inertial_bodies(), *self.payloads]
        slides = {body.coordinate for body in bodies.build_bodies() if body.joint == "prismatic"}
        return (
            *(Parameter(kind, name) for name in rigid for kind in INERTIAL),
            *(
                Parameter(kind, name, section.is_along_line(name, slides))
                for name, section in self.list_drives().items()
                for kind in section.get_values()
            ),
            *(
                Parameter(kind, force.drive.name, force.sliding)
                for force in self.list_forces()
                for kind in force.values
            ),
        )

    def get_body_parameters(self) -> dict[str, BodyParameters]:
        """Return the parameters of the chosen set by body, then those of payloads."""
        chosen = self.parameter_sets[self.parameters or next(iter(self.parameter_sets))]
        names = self.description.bodies.list_inertial_bodies()
        return {name: chosen.get(name, BodyParameters()) for name in names} | self.payloads

    def get_values(self) -> FloatArray:
        """Return the values of all parameters, (n_parameters,), SI."""
        rigid = [body.get_values() for body in self.get_body_parameters().values()]
        driven = [drive.get_values() for drive in self.list_drives().values()]
        forces = [force.values for force in self.list_forces()]
        return np.array([x for values in (*rigid, *driven, *forces) for x in values.values()])

    def has_masses(self) -> bool:
        """Whether the values of the parameters include a mass or a first moment."""
        kinds = [parameter.kind for parameter in self.list_parameters()]
        first = [kind in (Kind.M, Kind.MX, Kind.MY, Kind.MZ) for kind in kinds]
        return bool(np.any(self.get_values()[first]))

    def find_measured(self) -> BoolArray:
        """Return which independent coordinates have measured torques, (n_dof,)."""
        names = self.description.bodies.list_independent_coordinates()
        return np.array([name not in self.unmeasured for name in names])

    def get_nominal_torque(self) -> FloatArray | None:
        """Return the nominal torques if the config gives them, (n_dof,), N m or N, else None."""
        if self.nominal_torque == "standard-deviation":
            return None
        return expand_per_joint(self.nominal_torque, self.n_dof)
