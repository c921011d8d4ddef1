"""Clearances in a config: distances that bodies keep from each other and from planes."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import Annotated

import numpy as np
from pydantic import Field

from paramreduce_cli.errors import ConfigError
from paramreduce_cli.fields.numbers import Number, Whole
from paramreduce_cli.fields.section import Name, Positive, Section, Triple
from paramreduce_cli.records import BASE, Constraint, FloatArray, Mechanism
from paramreduce_cli.robots.placement import Direction

BASE_NAME = "base"
_KEY = ("trajectories", "clearance")


class CapsuleSection(Section):
    """A capsule: all points within a radius of a line between two points of a body's frame."""

    start: Triple = [0, 0, 0]
    """One end, m."""
    end: Triple
    """The other, m."""
    radius: Positive
    """m"""


class PlaneSection(Section):
    """A plane that bodies stay above."""

    name: Name
    """Name for messages and tables."""
    point: Triple = [0, 0, 0]
    """A point of it in the base frame, m."""
    normal: Direction = [0, 0, 1]
    """Direction in which the bodies are, in the base frame."""


class ClearanceSection(Section):
    """A set of distances that bodies must keep from each other and from planes.

    By default every body is a capsule from its own joint to the next.
    """

    radius: Positive = 0.06
    """Radius of capsules that are not given, m."""
    gap: Annotated[Number, Field(ge=0)] = 0.01
    """Distance that is left between surfaces, m."""
    capsules: dict[Name, list[CapsuleSection]] = {}
    """Capsules by body, `base` for the base; an empty list for a body that is not checked."""
    apart: Annotated[Whole, Field(ge=2)] = 3
    """Joints between two bodies from which on they are looked at; nearer ones cannot get apart."""
    ignore: list[Annotated[list[Name], Field(min_length=2, max_length=2)]] = []
    """Pairs of bodies that are not looked at."""
    planes: list[PlaneSection] = []
    """Planes that bodies stay above; the base and bodies on the first joint are not checked."""

    def build_constraints(self, mechanism: Mechanism) -> Iterator[Constraint]:
        """Yield a constraint for each pair of bodies, and for each body and plane.

        Raises:
            ConfigError: A named body does not exist.
        """
        spheres = self._cover_bodies(mechanism)
        ignored = {frozenset(pair) for pair in self.ignore}
        names = {BASE: BASE_NAME} | {k: body.name for k, body in enumerate(mechanism.bodies)}
        for a, b in combinations(spheres, 2):
            near = _count_joints_between(mechanism, a, b) < self.apart
            if near or frozenset((names[a], names[b])) in ignored:
                continue
            (points_a, radii_a), (points_b, radii_b) = spheres[a], spheres[b]
            yield Constraint(
                name=f"{names[a]}-{names[b]}", kind="clearance", bodies=(a, b),
                vectors=(points_a, radii_a, points_b, radii_b), lower=self.gap, upper=np.inf,
            )  # fmt: skip
        for plane in self.planes:
            normal = np.array(plane.normal, dtype=float)
            frame = np.vstack([plane.point, normal / np.linalg.norm(normal)])
            for body, (points, radii) in spheres.items():
                if _count_joints_between(mechanism, BASE, body) > 1:
                    yield Constraint(
                        name=f"{names[body]}-{plane.name}", kind="above-plane", bodies=(body, BASE),
                        vectors=(points, radii, frame), lower=self.gap, upper=np.inf,
                    )  # fmt: skip

    def _cover_bodies(self, mechanism: Mechanism) -> dict[int, tuple[FloatArray, FloatArray]]:
        """Return centres (k, 3) and radii (k,) of spheres that cover the capsules of each body.

        Raises:
            ConfigError: A capsule or an ignored pair names a body that the robot lacks.
        """
        numbers = {body.name: k for k, body in enumerate(mechanism.bodies)} | {BASE_NAME: BASE}
        named = [*self.capsules, *(name for pair in self.ignore for name in pair)]
        for name in named:
            if name not in numbers:
                raise ConfigError(f"names the body {name}; there is {', '.join(numbers)}.", _KEY)
        found = {}
        for name, body in sorted(numbers.items(), key=lambda item: item[1]):
            given = self.capsules.get(name)
            capsules = self._build_default_capsules(mechanism, body) if given is None else given
            covers = [
                _cover_capsule(np.array([c.start, c.end], dtype=float), c.radius) for c in capsules
            ]
            if covers:
                points, radii = zip(*covers, strict=True)
                found[body] = (np.vstack(points), np.concatenate(radii))
        return found

    def _build_default_capsules(self, mechanism: Mechanism, body: int) -> list[CapsuleSection]:
        """Return capsules from a body's joint to the joints that the body carries."""
        ends = [other.parent_to_joint[:3, 3] for other in mechanism.bodies if other.parent == body]
        if not ends and body != BASE:
            ends = [np.zeros(3)]
        return [CapsuleSection(end=end.tolist(), radius=self.radius) for end in ends]


def _cover_capsule(ends: FloatArray, radius: float) -> tuple[FloatArray, FloatArray]:
    """Return spheres, a radius apart and slightly larger, that cover a capsule completely."""
    length = float(np.linalg.norm(ends[1] - ends[0]))
    count = int(np.ceil(length / radius)) + 1
    half = length / max(1, count - 1) / 2
    points = np.linspace(ends[0], ends[1], count)
    return points, np.full(count, float(np.hypot(radius, half)))


def _count_joints_between(mechanism: Mechanism, a: int, b: int) -> int:
    """Return the number of joints on the path through the tree from one body to another."""
    way_a, way_b = (_list_path_to_base(mechanism, body) for body in (a, b))
    common = len(set(way_a) & set(way_b))
    return len(way_a) + len(way_b) - 2 * common


def _list_path_to_base(mechanism: Mechanism, body: int) -> list[int]:
    """Return the bodies from a body to the base, the body first."""
    path = []
    while body != BASE:
        path.append(body)
        body = mechanism.bodies[body].parent
    return path
