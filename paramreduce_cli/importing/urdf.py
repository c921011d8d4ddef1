"""URDF files, read with lxml: messages name lines, entities are not resolved, nothing is fetched.

What is needed of the format is five elements; a library for it would bring meshes, images and a
scene graph along, and knows no lines.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from paramreduce_cli.errors import ConfigError
from paramreduce_cli.importing.angles import angle_text, near_angle, unround_angle, without_dust
from paramreduce_cli.importing.imported import (
    ImportedJoint,
    ImportedRobot,
    Inertial,
    Mimic,
    Steps,
    matrix,
)

_LARGEST = 50_000_000
_KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_FARTHEST, _FASTEST, _STRONGEST = 1e3, 1e3, 1e6
"""What is meant to be no limit is beyond: rad or m, rad/s or m/s, N m or N."""
_SNAPPED = 1e-11
"""Change of an angle from which on it is told, rad."""


def read_urdf(path: Path) -> ImportedRobot:
    """Read a URDF file.

    Raises:
        ConfigError: It cannot be read, or is no URDF; names file, line and element.
    """
    return _Reader(path).robot()


class _Reader:
    def __init__(self, path: Path) -> None:
        self._path = path
        self._warnings: list[str] = []
        self._root = self._parsed()

    def _parsed(self) -> Any:
        from lxml import etree

        try:
            if not self._path.is_file():
                raise ConfigError(
                    f"{self._path}: is no file, nor a robot that an installed robot_descriptions knows; give the path of a URDF or MJCF."
                )
            if self._path.stat().st_size > _LARGEST:
                raise ConfigError(f"{self._path}: is larger than 50 MB, which no URDF is.")
            content = self._path.read_bytes()
        except OSError as error:
            raise ConfigError(f"{self._path}: cannot be read: {error.strerror}.") from error
        parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True)
        try:
            root = etree.fromstring(content, parser)
        except etree.XMLSyntaxError as error:
            line, _ = error.position
            raise ConfigError(f"{self._path}, line {line}: is no XML: {error.msg}.") from error
        if root.getroottree().docinfo.internalDTD is not None:
            raise self._wrong(root, "declares a document type; a URDF has none, take it out")
        if root.tag == "mujocoinclude":
            raise self._wrong(root, "is a part of an MJCF; give the file that includes it")
        if root.tag != "robot":
            raise self._wrong(root, "is no URDF, whose outermost element is <robot>")
        for element in root.iter("{*}*"):
            if "xacro" in str(element.tag) or any("${" in text for text in element.values()):
                raise self._wrong(
                    element,
                    f"is xacro that was not expanded; run `xacro {self._path.name} > robot.urdf` and give "
                    "robot.urdf",
                )
        return root

    def _wrong(self, element: Any, text: str) -> ConfigError:
        name = element.get("name")
        shown = f"<{element.tag} name={name!r}>" if name else f"<{element.tag}>"
        return ConfigError(f"{self._path}, line {element.sourceline}: {shown} {text}.")

    def robot(self) -> ImportedRobot:
        links: dict[str, Inertial | None] = {}
        for element in self._root.findall("link"):
            name = self._name(element)
            if name in links:
                raise self._wrong(element, "stands there twice; every link needs a name of its own")
            links[name] = self._inertial(element)
        joints = tuple(self._joint(e, links) for e in self._root.findall("joint"))
        if not links:
            raise self._wrong(self._root, "has no links")
        self._check_tree(joints)
        joints = self._followed(joints)
        name = self._root.get("name") or self._path.stem
        return ImportedRobot(name, str(self._path), links, joints, warnings=tuple(self._warnings))

    def _name(self, element: Any) -> str:
        name = element.get("name")
        if not name:
            raise self._wrong(element, "has no name")
        return str(name)

    def _numbers(self, element: Any, key: str, count: int, default: str) -> list[str]:
        """The texts of some numbers, checked."""
        texts = element.get(key, default).split()
        try:
            good = len(texts) == count and all(math.isfinite(float(text)) for text in texts)
        except ValueError:
            good = False
        if not good:
            what = "a number" if count == 1 else f"{count} numbers"
            raise self._wrong(element, f"has {key}={element.get(key)!r}; {what} should stand there")
        return texts

    def _limit(self, element: Any, key: str, most: float) -> float | None:
        """A number that limits something; None where there is none, or one that limits nothing."""
        if element is None or element.get(key) is None:
            return None
        value = float(self._numbers(element, key, 1, "")[0])
        if value < 0 and key in ("velocity", "effort"):
            self._warnings.append(
                f"line {element.sourceline}: {key}={value:g} is taken for {-value:g}"
            )
        return value if abs(value) <= most else None

    def _origin(self, element: Any, owner: str) -> Steps:
        """The steps of an <origin>: shift, then yaw, pitch and roll."""
        origin = element.find("origin")
        if origin is None:
            return ()
        shift = tuple(
            without_dust(float(text)) for text in self._numbers(origin, "xyz", 3, "0 0 0")
        )
        steps: list[tuple[str, float | tuple[float, ...]]] = [("xyz", shift)] if any(shift) else []
        texts = self._numbers(origin, "rpy", 3, "0 0 0")
        for key, text in reversed(list(zip(("rx", "ry", "rz"), texts, strict=True))):
            angle = unround_angle(text)
            if abs(angle - float(text)) > _SNAPPED:
                self._warnings.append(f"{owner}: {key} {text} is taken for {angle:.15g}")
            elif (near := near_angle(text)) is not None:
                self._warnings.append(
                    f"{owner}: {key} {text} is kept; it is near {angle_text(near)}, but not what that is rounded to. "
                    f"Write {near:.10g} into the file if that is meant"
                )
            if angle:
                steps.append((key, angle))
        return tuple(steps)

    def _inertial(self, link: Any) -> Inertial | None:
        element = link.find("inertial")
        if element is None:
            return None
        mass, tensor = element.find("mass"), element.find("inertia")
        if mass is None or tensor is None:
            raise self._wrong(element, f"of {link.get('name')} needs <mass> and <inertia>")
        m = float(self._numbers(mass, "value", 1, "")[0])
        xx, xy, xz, yy, yz, zz = (float(self._numbers(tensor, k, 1, "0")[0]) for k in _TENSOR)
        about_com = Inertial(m, np.zeros(3), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
        return about_com.seen(matrix(self._origin(element, f"inertial of {link.get('name')}")))

    def _joint(self, element: Any, links: dict[str, Inertial | None]) -> ImportedJoint:
        name, kind = self._name(element), element.get("type")
        if kind not in _KINDS:
            raise self._wrong(element, f"has type={kind!r}; known are {', '.join(_KINDS)}")
        ends = []
        for key in ("parent", "child"):
            end = element.find(key)
            link = end.get("link") if end is not None else None
            if link not in links:
                raise self._wrong(element, f"has the {key} {link!r}, which is no link of the file")
            ends.append(link)
        limit = element.find("limit")
        lower, upper = (self._limit(limit, key, _FARTHEST) for key in ("lower", "upper"))
        if lower is not None and upper is not None and lower > upper:
            raise self._wrong(
                limit, f"of {name} has its lower limit {lower:g} above its upper {upper:g}"
            )
        return ImportedJoint(
            name=name,
            kind=kind,
            parent=ends[0],
            child=ends[1],
            origin=self._origin(element, name),
            axis=self._axis(element, kind),
            lower=lower,
            upper=upper,
            velocity=self._limit(limit, "velocity", _FASTEST),
            effort=self._limit(limit, "effort", _STRONGEST),
            mimic=self._mimic(element),
            drive=self._drive(element),
            line=element.sourceline,
        )

    def _drive(self, joint: Any) -> dict[str, float]:
        element = joint.find("dynamics")
        if element is None:
            return {}
        keys = {"viscous": "damping", "coulomb": "friction"}
        given = {key: float(self._numbers(element, name, 1, "0")[0]) for key, name in keys.items()}
        return {key: value for key, value in given.items() if value}

    def _mimic(self, joint: Any) -> Mimic | None:
        element = joint.find("mimic")
        if element is None:
            return None
        ratio = float(self._numbers(element, "multiplier", 1, "1")[0])
        return Mimic(
            element.get("joint", ""), ratio, float(self._numbers(element, "offset", 1, "0")[0])
        )

    def _followed(self, joints: tuple[ImportedJoint, ...]) -> tuple[ImportedJoint, ...]:
        """The joints; those that follow one that is not there move on their own."""
        names = {joint.name for joint in joints}
        result = []
        for joint in joints:
            lost = joint.mimic is not None and joint.mimic.joint not in names
            if lost and joint.mimic is not None:
                self._warnings.append(
                    f"{joint.name} follows {joint.mimic.joint!r}, which is no joint: it moves on its own"
                )
            result.append(dataclasses.replace(joint, mimic=None) if lost else joint)
        self._check_circles(result)
        return tuple(result)

    def _check_circles(self, joints: list[ImportedJoint]) -> None:
        by_name = {joint.name: joint for joint in joints}
        for joint in joints:
            seen, follower = {joint.name}, joint
            while follower.mimic is not None:
                if follower.mimic.joint in seen:
                    raise ConfigError(
                        f"{self._path}, line {follower.line}: <joint name={follower.name!r}> follows itself "
                        "in a circle."
                    )
                seen.add(follower.mimic.joint)
                follower = by_name[follower.mimic.joint]

    def _axis(self, joint: Any, kind: str) -> tuple[float, float, float]:
        element = joint.find("axis")
        if element is None or kind in ("fixed", "floating"):
            return (1.0, 0.0, 0.0)
        axis = np.array([float(text) for text in self._numbers(element, "xyz", 3, "1 0 0")])
        length = float(np.linalg.norm(axis))
        if length < 1e-6:
            raise self._wrong(joint, "has an axis without a direction")
        x, y, z = (without_dust(float(value)) for value in axis / length)
        return (x, y, z)

    def _check_tree(self, joints: tuple[ImportedJoint, ...]) -> None:
        names: set[str] = set()
        above: dict[str, ImportedJoint] = {}
        for joint in joints:
            where = f"{self._path}, line {joint.line}: <joint name={joint.name!r}>"
            if joint.name in names:
                raise ConfigError(f"{where} stands there twice; every joint needs its own name.")
            if joint.child in above:
                raise ConfigError(
                    f"{where} carries {joint.child!r}, as {above[joint.child].name!r} does; a URDF is a "
                    "tree. Leave one out here and close the loop in the config."
                )
            names.add(joint.name)
            above[joint.child] = joint
        for joint in joints:
            if joint.child in _ancestors(joint.parent, above):
                raise ConfigError(
                    f"{self._path}, line {joint.line}: <joint name={joint.name!r}> closes a circle of links."
                )


def _ancestors(link: str, above: dict[str, ImportedJoint]) -> Iterator[str]:
    seen: set[str] = set()
    while link not in seen:
        yield link
        seen.add(link)
        if link not in above:
            return
        link = above[link].parent
