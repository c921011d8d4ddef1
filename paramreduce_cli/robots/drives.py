"""Rotors, friction and springs as a YAML gives them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from paramreduce_cli.fields.names import Problem, UnknownNameError
from paramreduce_cli.fields.numbers import Number
from paramreduce_cli.fields.section import Section
from paramreduce_cli.records import DRIVE, Drive, Kind

ALL = "all"
"""Key of what every driven coordinate has."""

Value = Number | Literal["unknown"]


class DriveSection(Section):
    """What acts along one coordinate, or along a sum of several, besides the inertia of bodies; each value a number, or `unknown` for a parameter that is yet to be found."""

    motion: Annotated[dict[str, Number], Field(min_length=1)] | None = None
    """Weights of the coordinates in the motion it acts along, such as {z_1: 100} for a motor behind a gear; if left out the coordinate it is named after."""
    inertia: Value | None = None
    """Of the rotor, seen from the motion: kg m^2 (kg if it slides)."""
    viscous: Value | None = None
    """Viscous friction, N m s/rad (N s/m)."""
    coulomb: Value | None = None
    """Coulomb friction, N m (N), times the sign of the speed or its smooth form."""
    offset: Value | None = None
    """Constant torque or force, N m (N)."""
    stiffness: Value | None = None
    """Of a spring, N m/rad (N/m)."""
    rest: Number = 0.0
    """Where the spring is slack, rad (m)."""
    smoothing: Annotated[Number, Field(ge=0)] = 0.0
    """Coulomb friction goes as tanh(speed / smoothing), rad/s (m/s); zero for the true sign."""

    @model_validator(mode="after")
    def _acts(self) -> DriveSection:
        if not self.effects() and "smoothing" not in self.model_fields_set:
            raise ValueError(f"says nothing; give one of {', '.join(kind.key for kind in DRIVE)}")
        return self

    def effects(self) -> dict[Kind, float]:
        """Values of its parameters by kind; zero for those yet to be found."""
        given = {kind: getattr(self, kind.key) for kind in DRIVE}
        return {
            kind: 0.0 if value == "unknown" else value
            for kind, value in given.items()
            if value is not None
        }

    def unknown(self) -> list[str]:
        """Keys of the values that are yet to be found."""
        return [kind.key for kind in DRIVE if getattr(self, kind.key) == "unknown"]

    def over(self, other: DriveSection | None) -> DriveSection:
        """The same, with what it leaves out taken from another one."""
        if other is None:
            return self
        own = {key: getattr(self, key) for key in self.model_fields_set}
        return other.model_copy(update=own)

    def drive(self, name: str, coordinates: Sequence[str]) -> Drive:
        """The drive as a record.

        Args:
            name: Of the drive.
            coordinates: Names of the generalised coordinates.
        """
        weights = np.zeros(len(coordinates))
        for coordinate, weight in (self.motion or {name: 1.0}).items():
            weights[coordinates.index(coordinate)] = weight
        return Drive(name, weights, self.smoothing, self.rest)


def by_drive(
    sections: Mapping[str, DriveSection], driven: Iterable[str]
) -> dict[str, DriveSection]:
    """The section of every drive, with what all driven coordinates have.

    Args:
        sections: As given.
        driven: Names of the driven coordinates.
    """
    general = sections.get(ALL)
    found = dict.fromkeys(driven, general) if general is not None else {}
    for name, section in sections.items():
        if name != ALL:
            found[name] = section.over(found.get(name))
    return {name: section for name, section in found.items() if section.effects()}


def problems(sections: Mapping[str, DriveSection], coordinates: Sequence[str]) -> Iterator[Problem]:
    """What does not fit the mechanism, by the keys below ``drives``."""
    for name, section in sections.items():
        if name == ALL and section.motion is not None:
            yield (ALL, "motion"), "is for one drive; give that a name of its own"
        elif name != ALL and section.motion is None and name not in coordinates:
            message = UnknownNameError("coordinate", name, coordinates)
            yield (name,), f"{message} A drive of another name needs a motion"
        for coordinate, weight in (section.motion or {}).items():
            if coordinate not in coordinates:
                yield (
                    (name, "motion", coordinate),
                    UnknownNameError("coordinate", coordinate, coordinates),
                )
            elif weight == 0:
                yield (name, "motion", coordinate), "has the weight zero; leave it out"
