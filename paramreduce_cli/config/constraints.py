"""Constraints in a config: bounds on quantities of a mechanism."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from paramreduce_cli.fields.numbers import Number
from paramreduce_cli.fields.section import Name, Section, Triple
from paramreduce_cli.records import BASE, DISTANCES, Constraint, Mechanism
from paramreduce_cli.robots.placement import Direction

_QUANTITY_KEYS = {
    "coordinate": ({"coordinate"}, set()),
    "angle": ({"bodies"}, {"axes"}),
    "distance": ({"bodies"}, {"points"}),
    "distance-from-axis": ({"body"}, {"point", "axis_body", "axis_point", "axis"}),
    "singularity": (set(), set()),
}
"""Keys that each quantity needs, and those it may have besides."""


class ConstraintSection(Section):
    """A constraint: bounds on a quantity of the mechanism."""

    name: Name
    """Name for messages and tables."""
    quantity: Literal["coordinate", "angle", "distance", "distance-from-axis", "singularity"]
    """`coordinate`: any coordinate, rad or m; `angle` between two axes, rad; `distance` between two points, m; `distance-from-axis` of a point, m; `singularity`: distance of the loops to singularity, 0 to 1."""
    min: Number | None = None
    """Smallest value."""
    max: Number | None = None
    """Largest value."""
    coordinate: Name | None = None
    """Name of a coordinate, dependent ones too."""
    bodies: Annotated[list[Name], Field(min_length=2, max_length=2)] | None = None
    """The two bodies of an angle or a distance, `base` for the base."""
    axes: Annotated[list[Direction], Field(min_length=2, max_length=2)] = [[0, 0, 1], [0, 0, 1]]
    """Axes of an angle, each in its body's frame."""
    points: Annotated[list[Triple], Field(min_length=2, max_length=2)] = [[0, 0, 0], [0, 0, 0]]
    """Points of a distance, each in its body's frame, m."""
    body: Name | None = None
    """Body whose distance from an axis is meant."""
    point: Triple = [0, 0, 0]
    """Point in its frame, m."""
    axis_body: Name = "base"
    """Body that carries the axis."""
    axis_point: Triple = [0, 0, 0]
    """Point of the axis in that body's frame, m."""
    axis: Direction = [0, 0, 1]
    """Direction of the axis in that body's frame."""

    @model_validator(mode="after")
    def _check_keys(self) -> ConstraintSection:
        """Raise ValueError if keys are missing, or do not belong to the quantity."""
        needed, possible = _QUANTITY_KEYS[self.quantity]
        given = self.model_fields_set - {"name", "quantity", "min", "max"}
        if missing := needed - given:
            raise ValueError(f"{self.quantity} needs {', '.join(sorted(missing))}")
        if surplus := given - needed - possible:
            raise ValueError(f"{self.quantity} takes no {', '.join(sorted(surplus))}")
        if self.min is None and self.max is None:
            raise ValueError("give min or max, or both")
        if self.min is not None and self.max is not None and self.min >= self.max:
            raise ValueError(f"the bounds cross: {self.min:g} is not below {self.max:g}")
        given_bounds = [bound for bound in (self.min, self.max) if bound is not None]
        if self.quantity in DISTANCES and min(given_bounds) <= 0:
            raise ValueError("bounds of a distance are above zero")
        if self.quantity == "angle" and not all(0 < bound < np.pi for bound in given_bounds):
            raise ValueError("bounds of an angle between axes are between 0 and pi")
        if self.quantity == "singularity" and (self.max is not None or not 0 < (self.min or 0) < 1):
            raise ValueError("distance to singularity takes a min between 0 and 1 and no max")
        return self

    def build_constraint(self, mechanism: Mechanism) -> Constraint:
        """Return the constraint as a record."""
        bodies = {body.name: k for k, body in enumerate(mechanism.bodies)} | {"base": BASE}
        owners: list[int] = []
        vectors: list[list[float]] = []
        if self.quantity == "coordinate":
            owners = [mechanism.generalised_names.index(self.coordinate or "")]
        elif self.quantity == "distance-from-axis":
            owners = [bodies[self.body or ""], bodies[self.axis_body]]
            vectors = [self.point, self.axis_point, self.axis]
        elif self.quantity in ("angle", "distance"):
            owners = [bodies[name] for name in self.bodies or []]
            vectors = self.axes if self.quantity == "angle" else self.points
        return Constraint(
            name=self.name,
            kind=self.quantity,
            bodies=tuple(owners),
            vectors=tuple(np.array(vector, dtype=float) for vector in vectors),
            lower=-np.inf if self.min is None else self.min,
            upper=np.inf if self.max is None else self.max,
        )
