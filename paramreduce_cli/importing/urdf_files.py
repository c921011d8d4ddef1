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
from paramreduce_cli.importing.angles import (
    clear_rounding,
    find_near_angle,
    format_angle,
    unround_angle,
)
from paramreduce_cli.importing.imported_robot import (
    ImportedJoint,
    ImportedRobot,
    Inertial,
    Mimic,
    Steps,
    to_transform,
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
        ConfigError: The file cannot be read, or is no URDF; the message names file, line and element.
    """
    return _Reader(path).read_robot()


class _Reader:
    """A reader of one URDF file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._warnings: list[str] = []
        self._root = self._parse_file()

    def _parse_file(self) -> Any:
        """Return the outermost element of the file, or raise ConfigError if it is no URDF."""
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
            raise self._make_error(root, "declares a document type; a URDF has none, take it out")
        if root.tag == "mujocoinclude":
            raise self._make_error(root, "is a part of an MJCF; give the file that includes it")
        if root.tag != "robot":
            raise self._make_error(root, "is no URDF, whose outermost element is <robot>")
        for element in root.iter("{*}*"):
            if "xacro" in str(element.tag) or any("${" in text for text in element.values()):
                raise self._make_error(
                    element,
                    f"is xacro that was not expanded; run `xacro {self._path.name} > robot.urdf` and give "
                    "robot.urdf",
                )
        return root

    def _make_error(self, element: Any, text: str) -> ConfigError:
        """Return the error that an element is wrong, with its line."""
        name = element.get("name")
        shown = f"<{element.tag} name={name!r}>" if name else f"<{element.tag}>"
        return ConfigError(f"{self._path}, line {element.sourceline}: {shown} {text}.")

    def read_robot(self) -> ImportedRobot:
        """Return the robot with its links and joints.

        Raises:
            ConfigError: There are no links, or two have one name.
        """
        links: dict[str, Inertial | None] = {}
        for element in self._root.findall("link"):
            name = self._get_name(element)
            if name in links:
                raise self._make_error(
                    element, "is listed twice; every link needs a name of its own"
                )
            links[name] = self._read_inertia(element)
        joints = tuple(self._read_joint(e, links) for e in self._root.findall("joint"))
        if not links:
            raise self._make_error(self._root, "has no links")
        self._check_tree(joints)
        joints = self._drop_lost_mimics(joints)
        name = self._root.get("name") or self._path.stem
        return ImportedRobot(name, str(self._path), links, joints, warnings=tuple(self._warnings))

    def _get_name(self, element: Any) -> str:
        """Return the name of an element, or raise ConfigError if it has none."""
        name = element.get("name")
        if not name:
            raise self._make_error(element, "has no name")
        return str(name)

    def _read_numbers(self, element: Any, key: str, count: int, default: str) -> list[str]:
        """Return the texts of an attribute's numbers, or raise ConfigError if they are no numbers."""
        texts = element.get(key, default).split()
        try:
            good = len(texts) == count and all(math.isfinite(float(text)) for text in texts)
        except ValueError:
            good = False
        if not good:
            what = "a number" if count == 1 else f"{count} numbers"
            raise self._make_error(
                element, f"has {key}={element.get(key)!r}; {what} should stand there"
            )
        return texts

    def _read_limit(self, element: Any, key: str, most: float) -> float | None:
        """Return a limit; None if there is none, or one that limits nothing."""
        if element is None or element.get(key) is None:
            return None
        value = float(self._read_numbers(element, key, 1, "")[0])
        if value < 0 and key in ("velocity", "effort"):
            self._warnings.append(
                f"line {element.sourceline}: {key}={value:g} is taken for {-value:g}"
            )
        return value if abs(value) <= most else None

    def _read_origin(self, element: Any, owner: str) -> Steps:
        """Return the steps of an <origin>: a shift, then yaw, pitch and roll."""
        origin = element.find("origin")
        if origin is None:
            return ()
        shift = tuple(
            clear_rounding(float(text)) for text in self._read_numbers(origin, "xyz", 3, "0 0 0")
        )
        steps: list[tuple[str, float | tuple[float, ...]]] = [("xyz", shift)] if any(shift) else []
        texts = self._read_numbers(origin, "rpy", 3, "0 0 0")
        for key, text in reversed(list(zip(("rx", "ry", "rz"), texts, strict=True))):
            angle = unround_angle(text)
            if abs(angle - float(text)) > _SNAPPED:
                self._warnings.append(f"{owner}: {key} {text} is taken for {angle:.15g}")
            elif (near := find_near_angle(text)) is not None:
                self._warnings.append(
                    f"{owner}: {key} {text} is kept; it is near {format_angle(near)}, but not what that is rounded to. "
                    f"Write {near:.10g} into the file if that is meant"
                )
            if angle:
                steps.append((key, angle))
        return tuple(steps)

    def _read_inertia(self, link: Any) -> Inertial | None:
        """Return the inertia of a link, or None if it has none.

        Raises:
            ConfigError: The element lacks <mass> or <inertia>.
        """
        element = link.find("inertial")
        if element is None:
            return None
        mass, tensor = element.find("mass"), element.find("inertia")
        if mass is None or tensor is None:
            raise self._make_error(element, f"of {link.get('name')} needs <mass> and <inertia>")
        m = float(self._read_numbers(mass, "value", 1, "")[0])
        xx, xy, xz, yy, yz, zz = (float(self._read_numbers(tensor, k, 1, "0")[0]) for k in _TENSOR)
        about_com = Inertial(m, np.zeros(3), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
        return about_com.transform(
            to_transform(self._read_origin(element, f"inertial of {link.get('name')}"))
        )

    def _read_joint(self, element: Any, links: dict[str, Inertial | None]) -> ImportedJoint:
        """Return a joint with its limits, drive and mimic.

        Raises:
            ConfigError: The type or a link is unknown, or the lower limit is above the upper one.
        """
        name, kind = self._get_name(element), element.get("type")
        if kind not in _KINDS:
            raise self._make_error(element, f"has type={kind!r}; known are {', '.join(_KINDS)}")
        ends = []
        for key in ("parent", "child"):
            end = element.find(key)
            link = end.get("link") if end is not None else None
            if link not in links:
                raise self._make_error(
                    element, f"has the {key} {link!r}, which is no link of the file"
                )
            ends.append(link)
        limit = element.find("limit")
        lower, upper = (self._read_limit(limit, key, _FARTHEST) for key in ("lower", "upper"))
        if lower is not None and upper is not None and lower > upper:
            raise self._make_error(
                limit, f"of {name} has its lower limit {lower:g} above its upper {upper:g}"
            )
        return ImportedJoint(
            name=name,
            kind=kind,
            parent=ends[0],
            child=ends[1],
            origin=self._read_origin(element, name),
            axis=self._read_axis(element, kind),
            lower=lower,
            upper=upper,
            velocity=self._read_limit(limit, "velocity", _FASTEST),
            effort=self._read_limit(limit, "effort", _STRONGEST),
            mimic=self._read_mimic(element),
            drive=self._read_drive(element),
            line=element.sourceline,
        )

    def _read_drive(self, joint: Any) -> dict[str, float]:
        """Return friction and damping of a joint by the keys of a drive."""
        element = joint.find("dynamics")
        if element is None:
            return {}
        keys = {"viscous": "damping", "coulomb": "friction"}
        given = {
            key: float(self._read_numbers(element, name, 1, "0")[0]) for key, name in keys.items()
        }
        return {key: value for key, value in given.items() if value}

    def _read_mimic(self, joint: Any) -> Mimic | None:
        """Return the joint that a joint follows, with ratio and offset, or None."""
        element = joint.find("mimic")
        if element is None:
            return None
        ratio = float(self._read_numbers(element, "multiplier", 1, "1")[0])
        return Mimic(
            element.get("joint", ""), ratio, float(self._read_numbers(element, "offset", 1, "0")[0])
        )

    def _drop_lost_mimics(self, joints: tuple[ImportedJoint, ...]) -> tuple[ImportedJoint, ...]:
        """Return the joints; those that follow a joint that does not exist move on their own."""
        names = {joint.name for joint in joints}
        result = []
        for joint in joints:
            lost = joint.mimic is not None and joint.mimic.joint not in names
            if lost and joint.mimic is not None:
                self._warnings.append(
                    f"{joint.name} follows {joint.mimic.joint!r}, which is no joint: it moves on its own"
                )
            result.append(dataclasses.replace(joint, mimic=None) if lost else joint)
        self._check_mimic_cycles(result)
        return tuple(result)

    def _check_mimic_cycles(self, joints: list[ImportedJoint]) -> None:
        """Raise ConfigError if a joint follows itself through others."""
        by_name = {joint.name: joint for joint in joints}
        for joint in joints:
            seen, follower = {joint.name}, joint
            while follower.mimic is not None:
                if follower.mimic.joint in seen:
                    raise ConfigError(
                        f"{self._path}, line {follower.line}: <joint name={follower.name!r}> mimics itself in a circle."
                    )
                seen.add(follower.mimic.joint)
                follower = by_name[follower.mimic.joint]

    def _read_axis(self, joint: Any, kind: str) -> tuple[float, float, float]:
        """Return the axis of a joint with unit length.

        Raises:
            ConfigError: The axis is zero.
        """
        element = joint.find("axis")
        if element is None or kind in ("fixed", "floating"):
            return (1.0, 0.0, 0.0)
        axis = np.array([float(text) for text in self._read_numbers(element, "xyz", 3, "1 0 0")])
        length = float(np.linalg.norm(axis))
        if length < 1e-6:
            raise self._make_error(joint, "has an axis without a direction")
        x, y, z = (clear_rounding(float(value)) for value in axis / length)
        return (x, y, z)

    def _check_tree(self, joints: tuple[ImportedJoint, ...]) -> None:
        """Raise ConfigError unless names are unique and the joints make a tree."""
        names: set[str] = set()
        above: dict[str, ImportedJoint] = {}
        for joint in joints:
            where = f"{self._path}, line {joint.line}: <joint name={joint.name!r}>"
            if joint.name in names:
                raise ConfigError(f"{where} is listed twice; every joint needs its own name.")
            if joint.child in above:
                raise ConfigError(
                    f"{where} carries {joint.child!r}, as {above[joint.child].name!r} does; a URDF is a "
                    "tree. Leave one out here and close the loop in the config."
                )
            names.add(joint.name)
            above[joint.child] = joint
        for joint in joints:
            if joint.child in _iterate_ancestors(joint.parent, above):
                raise ConfigError(
                    f"{self._path}, line {joint.line}: <joint name={joint.name!r}> closes a circle of links."
                )


def _iterate_ancestors(link: str, above: dict[str, ImportedJoint]) -> Iterator[str]:
    """Yield a link and the links that carry it, up to the root or the first repetition."""
    seen: set[str] = set()
    while link not in seen:
        yield link
        seen.add(link)
        if link not in above:
            return
        link = above[link].parent
