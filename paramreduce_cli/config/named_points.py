"""Named points of a config: places in the base frame while all coordinates are zero, such as a vehicle's hardpoints.

Where a name stands for a point or a direction, it is replaced in the plain data by numbers in the frame of the body. So
frames that nothing turns keep the axes of the base, and loops are closed where all coordinates are zero.
"""

import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from paramreduce_cli.config.yaml_reading import Document
from paramreduce_cli.errors import Key
from paramreduce_cli.fields.names import Problem, UnknownNameError
from paramreduce_cli.fields.numbers import Number
from paramreduce_cli.records import FloatArray
from paramreduce_cli.robots.placement import Placement, compose_steps

_TREE: Key = ("description", "tree")
_DIGITS = 12
"""Digits after the point that are kept of differences of points, m."""
_DIRECTION = re.compile(r"^(-?)to (\S+)$")
_VECTOR: TypeAdapter[list[float]] = TypeAdapter(list[Number])
_PLACEMENT: TypeAdapter[Any] = TypeAdapter(Placement)


def resolve_points(document: Document, constants: Mapping[str, float]) -> list[Problem]:
    """Replace the names of points in the data of a document by numbers, and return what is wrong with them.

    Args:
        document: Document, whose data change.
        constants: Constants of the config.
    """
    tree = document.data.get("description")
    tree = tree.get("tree") if isinstance(tree, dict) else None
    if not isinstance(tree, dict):
        return []
    resolver = _Resolver(tree.get("points"), constants)
    try:
        resolver.resolve_tree(tree)
        resolver.resolve_elements(document.data)
    except _PointError as error:
        return [(error.path, error.problem)]
    return []


class _PointError(Exception):
    """Raised where the name of a point cannot be replaced by numbers."""

    def __init__(self, path: Key, problem: str | UnknownNameError) -> None:
        super().__init__(str(problem))
        self.path, self.problem = path, problem


class _Resolver:
    """A resolver of the names of points.

    Args:
        points: Points as the config gives them.
        constants: Constants of the config.
    """

    def __init__(self, points: Any, constants: Mapping[str, float]) -> None:
        self._context = {"constants": dict(constants)}
        self._points: dict[str, FloatArray] = {}
        self._unreadable: set[str] = set()
        """Names of points that are no three numbers."""
        self._frames: dict[str, FloatArray] = {"base": np.eye(4)}
        """Frames of the bodies in the base frame while all coordinates are zero, (4, 4), m."""
        for name, value in points.items() if isinstance(points, dict) else ():
            vector = self._read_vector(value)
            if vector is not None:
                self._points[str(name)] = vector
            else:
                self._unreadable.add(str(name))

    def resolve_tree(self, tree: dict[str, Any]) -> None:
        """Replace names in the bodies and closures of a tree."""
        for k, body in _iterate_dicts(tree.get("bodies")):
            path = (*_TREE, "bodies", k)
            parent = self._frames.get(str(body.get("parent", "base")), np.eye(4))
            if "at" in body:
                body["at"] = self._resolve_placement(body["at"], parent, (*path, "at"))
            frame = parent @ self._compose(body.get("at", []))
            if "axes" in body:
                body["axes"] = self._resolve_axes(body["axes"], frame, (*path, "axes"))
            self._frames[str(body.get("name"))] = frame
        for k, closure in _iterate_dicts(tree.get("closures")):
            names = closure.get("at")
            self._resolve_places(closure, (*_TREE, "closures", k))
            if closure.get("type") == "distance" and isinstance(names, list):
                ends = [self._points[n] for n in names if isinstance(n, str) and n in self._points]
                if len(ends) == 2:
                    closure.setdefault("length", float(np.linalg.norm(ends[1] - ends[0])))

    def resolve_elements(self, data: dict[str, Any]) -> None:
        """Replace names in forces, payloads and centres of mass."""
        for name, force in _iterate_dicts(data.get("forces")):
            self._resolve_places(force, ("forces", name))
        for name, payload in _iterate_dicts(data.get("payloads")):
            frame = self._frames.get(str(payload.get("body")), np.eye(4))
            if "at" in payload:
                place: Key = ("payloads", name, "at")
                payload["at"] = self._resolve_placement(payload["at"], frame, place)
            if isinstance(payload.get("com"), str):
                frame = frame @ self._compose(payload.get("at", []))
                payload["com"] = self._locate(payload["com"], frame, ("payloads", name, "com"))
        for chosen, bodies in _iterate_dicts(data.get("parameter_sets")):
            for name, body in _iterate_dicts(bodies):
                if isinstance(body.get("com"), str):
                    where: Key = ("parameter_sets", chosen, name, "com")
                    body["com"] = self._locate(
                        body["com"], self._frames.get(str(name), np.eye(4)), where
                    )

    def _resolve_places(self, element: dict[str, Any], path: Key) -> None:
        """Replace names in the two places of a closure or force element; one name stands for both."""
        bodies, at = element.get("bodies"), element.get("at")
        if not isinstance(bodies, list) or at is None:
            return
        both = [at] * len(bodies) if isinstance(at, str) else at
        if isinstance(both, list) and len(both) == len(bodies):
            element["at"] = [
                self._resolve_placement(
                    place, self._frames.get(str(body), np.eye(4)), (*path, "at")
                )
                for place, body in zip(both, bodies, strict=True)
            ]

    def _resolve_placement(self, at: Any, frame: FloatArray, path: Key) -> Any:
        """Return a placement with its named points as shifts, in a frame whose place in the base is given."""
        if isinstance(at, str) and not self._is_number(at):
            return self._locate(at, frame, path)
        if not isinstance(at, list) or not any(self._is_step(step) for step in at):
            return at
        steps = []
        for step in at:
            new = {"xyz": self._locate(step, frame, path)} if isinstance(step, str) else step
            frame = frame @ self._compose([new])
            steps.append(new)
        return steps

    def _is_step(self, step: Any) -> bool:
        """Return whether a part of a placement is a step or a named point, and not a component of a vector."""
        named = isinstance(step, str) and step in self._points and not self._is_number(step)
        return isinstance(step, dict) or named

    def _resolve_axes(self, axes: Any, frame: FloatArray, path: Key) -> Any:
        """Return the axes of a joint with directions to points as vectors."""
        if isinstance(axes, list):
            return [
                self._resolve_axes(axis, frame, path) if isinstance(axis, str) else axis
                for axis in axes
            ]
        found = _DIRECTION.match(str(axes))
        if found is None:
            return axes
        sign, name = found.groups()
        direction = np.array(self._locate(name, frame, path)) * (-1.0 if sign else 1.0)
        if not direction.any():
            raise _PointError(
                path,
                f"the joint is at the point {name} itself, so that there is no direction to it",
            )
        return direction.tolist()

    def _locate(self, name: str, frame: FloatArray, path: Key) -> list[float]:
        """Return a named point in a frame whose place in the base is given, (3,), m."""
        if name in self._unreadable:
            place: Key = (*_TREE, "points", name)
            raise _PointError(place, "must be three numbers [x, y, z], m")
        if name not in self._points:
            raise _PointError(path, UnknownNameError("point", name, list(self._points)))
        local = frame[:3, :3].T @ (self._points[name] - frame[:3, 3])
        return [float(x) + 0.0 for x in np.round(local, _DIGITS)]

    def _compose(self, at: Any) -> FloatArray:
        """Return the transform of a placement without names; the identity if it cannot be read."""
        try:
            return compose_steps(_PLACEMENT.validate_python(at, context=self._context))
        except ValidationError:
            return np.eye(4)

    def _read_vector(self, value: Any) -> FloatArray | None:
        """Return the numbers of a point, or None if they cannot be read."""
        try:
            numbers = _VECTOR.validate_python(value, context=self._context)
        except ValidationError:
            return None
        return np.array(numbers) if len(numbers) == 3 else None

    def _is_number(self, text: str) -> bool:
        """Return whether a text is arithmetic, and not a name."""
        return self._read_vector([text, 0, 0]) is not None


def _iterate_dicts(entries: Any) -> Iterator[tuple[Any, dict[str, Any]]]:
    """Yield keys or positions of the mappings in a mapping or a list."""
    pairs = (
        entries.items()
        if isinstance(entries, dict)
        else enumerate(entries if isinstance(entries, list) else [])
    )
    for key, entry in pairs:
        if isinstance(entry, dict):
            yield key, entry
