"""Drives in a YAML file: rotors, friction and springs."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from paramreduce_cli.fields.names import Problem, UnknownNameError
from paramreduce_cli.fields.numbers import Number
from paramreduce_cli.fields.section import Pair, Section
from paramreduce_cli.records import DRIVE, Drive, FrictionSearch, Kind

ALL = "all"
"""Key of what every driven coordinate has."""

Value = Number | Literal["unknown"]


def _check_table(points: list[list[float]]) -> list[list[float]]:
    """Return the points of a table, or raise ValueError unless their arguments ascend."""
    if any(one[0] >= other[0] for one, other in itertools.pairwise(points)):
        raise ValueError("the first numbers of a table's points must ascend")
    return points


Table = Annotated[list[Pair], Field(min_length=2, max_length=100), AfterValidator(_check_table)]
"""Points of a piecewise linear function, [[argument, value], ...]."""

_USUAL_FRICTION = (Kind.VISCOUS, Kind.COULOMB, Kind.OFFSET)
"""What a drive has whose friction a log decides."""
_PROVISIONAL_SMOOTHING = 0.05
"""Smoothing, rad/s (m/s), until a log decides."""


class ForceParameters(Section):
    """The parameters of a force along a motion; each value is a number, or `unknown` for a parameter that is still to be
    found.
    """

    viscous: Value | None = None
    """Viscous friction, N m s/rad (N s/m)."""
    coulomb: Value | None = None
    """Coulomb friction, N m (N), times the sign of the speed or its smooth form."""
    offset: Value | None = None
    """Constant torque or force, N m (N)."""
    stiffness: Value | None = None
    """Stiffness of a spring, N m/rad (N/m)."""
    rest: Number | Literal["static"] = 0.0
    """Position where the spring is slack, rad (m); static for the one with which springs balance all other forces in the design position."""
    stribeck: Value | None = None
    """Additional friction at low speed, N m (N); it fades beyond stribeck_velocity."""
    asymmetry: Value | None = None
    """Viscous friction with the same sign for both directions, N m s/rad (N s/m): friction that differs by direction."""
    quadratic: Value | None = None
    """Friction that goes as speed times its magnitude, N m s^2/rad^2 (N s^2/m^2)."""
    spring_table: Table | None = None
    """Points [position less `rest`, force] of a spring that is not linear, rad (m), N m (N); straight between them and beyond; one parameter scales the force."""
    damper_table: Table | None = None
    """Points [speed, force] of a damper that is not linear, rad/s (m/s), N m (N); straight between them and beyond; one parameter scales the force."""
    smoothing: Annotated[Number, Field(ge=0)] = 0.0
    """Coulomb friction goes as tanh(speed / smoothing), rad/s (m/s); zero for the true sign."""
    stribeck_velocity: Annotated[Number, Field(gt=0)] = 0.1
    """Stribeck friction goes as sign(speed) - tanh(speed / stribeck_velocity), rad/s (m/s), with the sign of Coulomb friction."""

    @model_validator(mode="after")
    def _check_not_empty(self) -> Self:
        """Raise ValueError if the section gives nothing."""
        if not self.get_values() and not {"smoothing", "stribeck_velocity"} & self.model_fields_set:
            raise ValueError(
                f"is empty; give one of {', '.join(k.key for k in self._list_kinds())}"
            )
        return self

    @model_validator(mode="after")
    def _check_static(self) -> Self:
        """Raise ValueError if a rest position is to be found, and there is no stiffness to find it with."""
        known = isinstance(self.stiffness, float | int) and self.stiffness > 0
        if self.rest == "static" and (not known or self.spring_table is not None):
            raise ValueError(
                "rest: static needs a stiffness that is known and positive, and no spring_table"
            )
        return self

    @classmethod
    def _list_kinds(cls) -> list[Kind]:
        """Return the kinds of parameters that the section has keys for."""
        return [kind for kind in DRIVE if kind.key in cls.model_fields]

    def _get_given(self) -> dict[Kind, Any]:
        """Return what the config gives for each kind of parameter: a number, a table, `unknown` or None."""
        return {kind: getattr(self, kind.key) for kind in self._list_kinds()}

    def get_values(self) -> dict[Kind, float]:
        """Return the values of the parameters by kind: zero for unknown ones, one for tables, which they scale."""
        special = {Kind.SPRING_TABLE: 1.0, Kind.DAMPER_TABLE: 1.0}
        return {
            kind: 0.0 if value == "unknown" else special.get(kind, value)
            for kind, value in self._get_given().items()
            if value is not None
        }

    def list_unknown(self) -> list[str]:
        """Return the keys of the values that are still to be found."""
        return [kind.key for kind, value in self._get_given().items() if value == "unknown"]

    def get_characteristic(self) -> dict[str, Any]:
        """Return what a drive's record says of its springs, dampers and friction, by field."""
        tables = {key: getattr(self, key) for key in ("spring_table", "damper_table")}
        arrays = {key: None if value is None else np.array(value) for key, value in tables.items()}
        return {
            "smoothing": self.smoothing,
            "rest": np.nan if self.rest == "static" else self.rest,
            "stribeck_velocity": self.stribeck_velocity,
            **arrays,
        }


class DriveSection(ForceParameters):
    """A drive along one coordinate, or along a weighted sum of several; each value is a number, or `unknown` for a
    parameter that is still to be found.
    """

    motion: Annotated[dict[str, Number], Field(min_length=1)] | None = None
    """Weights of the coordinates in the motion it acts along, such as {z_1: 100} for a motor behind a gear; if left out the coordinate it is named after."""
    inertia: Value | None = None
    """Inertia of the rotor, seen from the motion: kg m^2 (kg if it slides)."""
    load: Value | None = None
    """Friction per load, a plain number: it goes as the magnitude of the torque of gravity times the sign of the speed."""
    friction: Literal["given", "auto"] = "given"
    """With auto the log decides: viscous and Coulomb friction and an offset are unknown, smoothing is chosen, and stribeck, asymmetry, quadratic and load are added where they help."""

    def _get_given(self) -> dict[Kind, Any]:
        """Return what the config gives for each kind of parameter, and `unknown` for friction that a log decides."""
        given = super()._get_given()
        if self.friction == "auto":
            given |= {kind: "unknown" for kind in _USUAL_FRICTION if given[kind] is None}
        return given

    def apply_friction(self, search: FrictionSearch, k: int) -> DriveSection:
        """Return the section with the k-th friction that was found; terms that are added are unknown."""
        added = {
            Kind.STRIBECK: bool(np.isfinite(search.stribeck_velocity[k])),
            Kind.ASYMMETRY: bool(search.asymmetry[k]),
            Kind.QUADRATIC: bool(search.quadratic[k]),
            Kind.LOAD: bool(search.load[k]),
        }
        kinds = [*_USUAL_FRICTION, *(kind for kind, flag in added.items() if flag)]
        update: dict[str, object] = {
            kind.key: "unknown" for kind in kinds if getattr(self, kind.key) is None
        }
        if added[Kind.STRIBECK]:
            update["stribeck_velocity"] = float(search.stribeck_velocity[k])
        update |= {"smoothing": float(search.smoothing[k]), "friction": "given"}
        return self.model_copy(update=update)

    def is_along_line(self, name: str, slides: Collection[str]) -> bool:
        """Return whether the motion is in m and not in rad.

        Args:
            name: Name of the drive.
            slides: Names of the coordinates that slide.
        """
        return is_along_line(self.motion or {name: 1.0}, slides)

    def merge_defaults(self, other: DriveSection | None) -> DriveSection:
        """Return the section with missing keys taken from another one."""
        if other is None:
            return self
        own = {key: getattr(self, key) for key in self.model_fields_set}
        return other.model_copy(update=own)

    def build_drive(self, name: str, coordinates: Sequence[str]) -> Drive:
        """Return the drive as a record.

        Args:
            name: Name of the drive.
            coordinates: Names of the generalised coordinates.
        """
        weights = np.zeros(len(coordinates))
        for coordinate, weight in (self.motion or {name: 1.0}).items():
            weights[coordinates.index(coordinate)] = weight
        characteristic = self.get_characteristic()
        if self.friction == "auto" and "smoothing" not in self.model_fields_set:
            characteristic["smoothing"] = _PROVISIONAL_SMOOTHING
        return Drive(name, weights, **characteristic)


def is_along_line(motion: Mapping[str, float], slides: Collection[str]) -> bool:
    """Return whether a weighted sum of coordinates is in m and not in rad.

    A sum of sliding and turning coordinates has the unit of those whose weight is one: of the sliding ones if both have
    it, as where a point moves with a body that also turns.

    Args:
        motion: Weights by coordinate.
        slides: Names of the coordinates that slide.
    """
    sliding = [coordinate in slides for coordinate in motion]
    plain = [slide for slide, w in zip(sliding, motion.values(), strict=True) if abs(w) == 1]
    return all(sliding) or any(plain) or (any(sliding) and not plain)


def merge_drives(
    sections: Mapping[str, DriveSection], driven: Iterable[str]
) -> dict[str, DriveSection]:
    """Return the section of every drive, with the defaults for all driven coordinates merged in.

    Args:
        sections: Sections as given.
        driven: Names of the driven coordinates.
    """
    general = sections.get(ALL)
    found = dict.fromkeys(driven, general) if general is not None else {}
    for name, section in sections.items():
        if name != ALL:
            found[name] = section.merge_defaults(found.get(name))
    return {name: section for name, section in found.items() if section.get_values()}


def find_drive_problems(
    sections: Mapping[str, DriveSection], coordinates: Sequence[str], *, closed: bool
) -> Iterator[Problem]:
    """Yield contradictions with the mechanism, by the keys below ``drives``.

    Args:
        sections: Sections as given.
        coordinates: Names of the generalised coordinates.
        closed: Whether the mechanism has loops.
    """
    for name, section in sections.items():
        if section.load is not None and closed:
            yield (name, "load"), "is for open trees only, and this mechanism has loops; remove it"
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
                yield (name, "motion", coordinate), "has the weight zero; remove it"
