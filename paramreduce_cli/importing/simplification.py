"""An imported robot as the bodies of a config: links that cannot move against each other are one body."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from paramreduce_cli.config.schema import SourceSection
from paramreduce_cli.errors import ConfigError
from paramreduce_cli.fields.names import UnknownNameError
from paramreduce_cli.importing.imported_robot import (
    CLOSED_KINDS,
    ImportedClosure,
    ImportedJoint,
    ImportedRobot,
    Inertial,
    Steps,
    decompose_transform,
    merge_inertias,
    to_transform,
)
from paramreduce_cli.importing.inertia_checks import find_inertia_warnings
from paramreduce_cli.records import JOINT_COORDINATES, ClosureKind, FloatArray
from paramreduce_cli.robots.tree import rotate_z_to

BASE = "base"
"""What configs call the fixed base."""
_SINGLE = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic"}
_SEVERAL = {"floating": "free", "ball": "spherical"}
"""Kinds of joints in configs, with one coordinate and with several."""


@dataclass(frozen=True)
class ImportedBody:
    """One body of the config, with the joint that carries it."""

    name: str
    parent: str
    joint: str
    """A kind of joint of configs."""
    at: Steps = ()
    axis: tuple[float, ...] | None = None
    """None where the joint has none to choose."""
    coordinate: str | None = None
    """None where the joint has several, which are called after the body."""
    link: str | None = None
    """Name of the link in the file; None for a frame between the axes of a joint."""
    source: ImportedJoint | None = None
    """The joint in the file; None where there is none."""
    inertial: Inertial = field(default_factory=Inertial)
    massless: bool = False

    @property
    def limits(self) -> ImportedJoint | None:
        """Joint of the file whose limits are those of the body's one coordinate; None if there is no such joint."""
        single = self.source is not None and self.source.kind in _SINGLE
        return self.source if single else None

    def list_coordinates(self) -> list[str]:
        """Return the names of the joint's coordinates, as configs make them if none is given."""
        if self.coordinate is not None:
            return [self.coordinate]
        return [f"q_{self.name}_{k + 1}" for k in range(JOINT_COORDINATES[self.joint])]


@dataclass(frozen=True)
class Coupling:
    """A rule that the coordinate of one body's joint follows that of another body's joint."""

    leader: ImportedBody
    follower: ImportedBody
    ratio: float
    offset: float


@dataclass(frozen=True)
class Closure:
    """A closure that holds two bodies together besides their joints."""

    name: str
    kind: ClosureKind
    bodies: tuple[str, str]
    at: tuple[Steps, Steps]


@dataclass(frozen=True)
class SimplifiedRobot:
    """A robot of bodies in order, each after the body that carries it, with warnings for people."""

    name: str
    source: str
    bodies: tuple[ImportedBody, ...]
    couplings: tuple[Coupling, ...]
    closures: tuple[Closure, ...]
    independent: tuple[str, ...]
    """Coordinates that determine all others; all but the followers where the file says nothing, none of loops
    where they are still to be chosen."""
    gravity: tuple[float, ...]
    merged: Mapping[str, str]
    """Links that move with a body of another name, by name in the file."""
    frames: Mapping[str, FloatArray]
    """Frames of all links in those of the bodies they move with, (4, 4), by name in the file."""
    warnings: tuple[str, ...]
    guess: Mapping[str, float] = field(default_factory=dict)
    """Coordinates with which loops are closed, rad or m; those that are not zero."""

    def find_dependent_limits(self) -> dict[str, ImportedJoint]:
        """Return the joints of the file that limit dependent coordinates of loops, by coordinate."""
        dependent = {coupling.follower.coordinate for coupling in self.couplings}
        return {
            body.coordinate: body.limits
            for body in self.bodies
            if self.closures and body.coordinate is not None and body.limits is not None
            if body.limits.is_limited and body.coordinate not in {*self.independent, *dependent}
        }


def simplify_robot(robot: ImportedRobot, choice: SourceSection) -> SimplifiedRobot:
    """Merge links that cannot move against each other, and give everything names that configs allow.

    Raises:
        ConfigError: A name that is asked for is not there, or nothing moves.
    """
    return _Simplification(robot, choice).simplify()


class _Simplification:
    """A simplification of one robot as a source section asks."""

    def __init__(self, robot: ImportedRobot, choice: SourceSection) -> None:
        self._robot, self._choice = robot, choice
        self._asked_closures = tuple(_parse_closure(text) for text in choice.closed)
        self._warnings = [*robot.warnings, *find_inertia_warnings(robot.links)]
        self._children: dict[str, list[ImportedJoint]] = {}
        for joint in robot.joints:
            self._children.setdefault(joint.parent, []).append(joint)
        self._check_names()
        self._root = self._find_root()
        self._locked = dict(choice.locked or {})
        if choice.tip is not None:
            self._lock_other_branches(choice.tip)
        self._joints = {joint.name: joint for joint in robot.joints}
        self._lock_mimics()
        self._names = _Names(self._warnings)
        self._carried: dict[str, str] = {}
        self._frames: dict[str, FloatArray] = {}

    def _check_names(self) -> None:
        """Raise ConfigError if an option names a link or joint that does not exist."""
        choice = self._choice
        links, joints = list(self._robot.links), [joint.name for joint in self._robot.joints]
        named = [("--root", choice.root, links), ("--tip", choice.tip, links)]
        named += [("--ignore", name, links) for name in choice.ignored]
        named += [("--lock", name, joints) for name in choice.locked or {}]
        named += [("--close", name, links) for one in self._asked_closures for name in one.links]
        named += [("--independent", name, joints) for name in choice.independent]
        for option, name, known in named:
            if name is not None and name not in known:
                kind = "joint" if option in ("--lock", "--independent") else "link"
                raise ConfigError(f"{option} {name}: {UnknownNameError(kind, name, known)}")

    def _find_root(self) -> str:
        """Return the link that no joint carries, or the link that ``--root`` names.

        Raises:
            ConfigError: Several links are carried by no joint, and none is named.
        """
        if self._choice.root is not None:
            return self._choice.root
        carried = {joint.child for joint in self._robot.joints}
        roots = [name for name in self._robot.links if name not in carried]
        if len(roots) > 1:
            raise ConfigError(
                f"{self._robot.source}: no joint carries {', '.join(roots)}; a robot has one such link. "
                "Say which is meant with --root."
            )
        return roots[0]

    def _lock_other_branches(self, tip: str) -> None:
        """Lock the joints that are not on the path from the root to the tip.

        Raises:
            ConfigError: The root does not carry the tip.
        """
        above = {joint.child: joint for joint in self._robot.joints}
        chain, link = set(), tip
        while link != self._root:
            if link not in above:
                raise ConfigError(f"--tip {tip}: is not carried by the root {self._root}.")
            chain.add(above[link].name)
            link = above[link].parent
        beside = [j.name for j in self._robot.joints if j.kind != "fixed" and j.name not in chain]
        for name in beside:
            self._locked.setdefault(name, 0.0)
        if beside:
            self._warnings.append(f"not on the way to {tip}, so locked at 0: {', '.join(beside)}")

    def simplify(self) -> SimplifiedRobot:
        """Return the robot with fixed links merged, names made valid, and closures and couplings taken over.

        Raises:
            ConfigError: No joint is left that moves, or an option names what is not there.
        """
        bodies: list[ImportedBody] = []
        inertials: dict[str, list[Inertial]] = {}
        if self._choice.floating:
            name = self._names.name_body(self._root)
            bodies.append(ImportedBody(name, BASE, "free", link=self._root))
            waiting: list[tuple[str, str, Steps]] = [(self._root, name, ())]
        else:
            waiting = [(self._root, BASE, ())]
        while waiting:
            link, carrier, steps = waiting.pop()
            inertial = self._robot.links[link]
            self._carried[link] = carrier
            self._frames[link] = to_transform(steps)
            if inertial is not None:
                inertials.setdefault(carrier, []).append(inertial.transform(to_transform(steps)))
            for joint in reversed(self._children.get(link, [])):
                if joint.child in self._choice.ignored:
                    continue
                at = (*steps, *joint.origin)
                if joint.kind == "fixed" or joint.name in self._locked:
                    still = _to_steps(joint, self._locked.get(joint.name, 0.0))
                    waiting.append((joint.child, carrier, (*at, *still)))
                else:
                    waiting.append(
                        (joint.child, self._append_joint(joint, carrier, at, bodies), ())
                    )
        if not bodies:
            raise ConfigError(
                f"{self._robot.source}: no joint is left that moves; give --floating if "
                "the root moves freely.",
                options=("--floating",),
            )
        filled = [
            self._fill_body(body, inertials.get(body.name, [])) for body in _order_bodies(bodies)
        ]
        couplings = () if self._choice.uncoupled else self._list_couplings(filled)
        closures = self._list_closures()
        own = {body.link for body in bodies}
        merged = {link: body for link, body in self._carried.items() if link not in own}
        name = self._names.clean(self._robot.name) or "robot"
        return SimplifiedRobot(
            name,
            self._robot.source,
            tuple(filled),
            couplings,
            closures,
            self._choose_independent(filled, couplings, closures),
            self._robot.gravity,
            merged,
            self._frames,
            tuple(self._warnings),
        )

    def _list_closures(self) -> tuple[Closure, ...]:
        """Return the closures of the file and those of ``--close``, between bodies instead of links.

        Closures of the file are left out, with a warning, where one of their links is left out or both move as one
        body.

        Raises:
            ConfigError: A closure of ``--close`` has a link that is left out, or two that move as one body.
        """
        found = []
        for closure in (*self._robot.closures, *self._asked_closures):
            left_out = [link for link in closure.links if link not in self._carried]
            if left_out and closure in self._asked_closures:
                raise ConfigError(f"--close {'='.join(closure.links)}: {left_out[0]} is left out.")
            if left_out:
                self._warnings.append(f"{closure.name} holds a link that is left out, so it is too")
                continue
            one, other = (self._carried[link] for link in closure.links)
            if one == other and closure in self._asked_closures:
                raise ConfigError(
                    f"--close {'='.join(closure.links)}: both links move with {one}, so there is nothing to close."
                )
            if one == other:
                self._warnings.append(f"{closure.name} holds {one} to itself, so it is left out")
                continue
            first, second = (
                decompose_transform(self._frames[link] @ frame)
                for link, frame in zip(closure.links, closure.frames, strict=True)
            )
            name = self._names.name_closure(closure.name)
            found.append(Closure(name, closure.kind, (one, other), (first, second)))
        return tuple(found)

    def _choose_independent(
        self,
        bodies: list[ImportedBody],
        couplings: tuple[Coupling, ...],
        closures: tuple[Closure, ...],
    ) -> tuple[str, ...]:
        """Return the independent coordinates: those asked for, else those that the file leaves free.

        Raises:
            ConfigError: A coordinate named by ``--independent`` does not move, or options such as ``--lock`` are given
                for a file with loops, whose independent coordinates they may not change.
        """
        choice = self._choice
        moved = {body.source.name: body for body in bodies if body.source is not None}
        if choice.independent or (self._asked_closures and not self._robot.closures):
            still = [name for name in choice.independent if name not in moved]
            if still:
                raise ConfigError(f"--independent {still[0]}: does not move.")
            return tuple(
                name for joint in choice.independent for name in moved[joint].list_coordinates()
            )
        if closures:
            options = (choice.root, choice.tip, choice.locked, choice.ignored)
            if any(options) or choice.floating or choice.uncoupled:
                raise ConfigError(
                    f"{self._robot.source}: has closed loops, whose independent coordinates no choice may "
                    "change; import it whole and change the config."
                )
            return tuple(
                moved[joint].list_coordinates()[k]
                for joint, k in self._robot.independent
                if joint in moved
            )
        mimics = {coupling.follower.name for coupling in couplings}
        return tuple(n for b in bodies if b.name not in mimics for n in b.list_coordinates())

    def _append_joint(
        self, joint: ImportedJoint, carrier: str, at: Steps, bodies: list[ImportedBody]
    ) -> str:
        """Append the bodies of a joint, and return the name of the last body, which is the link."""
        name = self._names.name_body(joint.child)
        coordinate = self._names.name_coordinate(joint.name)
        own: dict[str, Any] = {
            "link": joint.child,
            "source": joint,
            "massless": joint.child in self._robot.massless,
        }
        if joint.kind in _SEVERAL:
            bodies.append(ImportedBody(name, carrier, _SEVERAL[joint.kind], at, **own))
        elif joint.kind == "planar":
            rotation = rotate_z_to(np.array(joint.axis))
            for k, letter in enumerate("xy"):
                slide, axis = (
                    self._names.name_body(f"{name}_{letter}"),
                    tuple(rotation[:, k].tolist()),
                )
                sliding = f"{coordinate}_{letter}"
                bodies.append(
                    ImportedBody(slide, carrier, "prismatic", at, axis, sliding, massless=True)
                )
                carrier, at = slide, ()
            bodies.append(
                ImportedBody(name, carrier, "revolute", at, joint.axis, coordinate, **own)
            )
        else:
            kind = _SINGLE[joint.kind]
            bodies.append(ImportedBody(name, carrier, kind, at, joint.axis, coordinate, **own))
        return name

    def _fill_body(self, body: ImportedBody, parts: list[Inertial]) -> ImportedBody:
        """Return a body with the merged inertia of its links, or massless if it has none."""
        inertial = merge_inertias(parts)
        if body.massless or inertial.mass:
            return replace(body, inertial=inertial)
        if self._robot.closures or self._asked_closures:
            self._warnings.append(
                f"{body.name} has no mass in the file, and is taken for massless, as links between the joints of a loop are"
            )
            body = replace(body, massless=True)
        else:
            self._warnings.append(f"{body.name} has no mass in the file: TODO")
        return replace(body, inertial=inertial)

    def _resolve_leader(self, joint: ImportedJoint) -> tuple[ImportedJoint, float, float]:
        """Return the joint at the end of a chain of followers, with ratio and offset to it."""
        ratio, offset = 1.0, 0.0
        while joint.mimic is not None:
            offset += ratio * joint.mimic.offset
            ratio *= joint.mimic.ratio
            joint = self._joints[joint.mimic.joint]
        return joint, ratio, offset

    def _lock_mimics(self) -> None:
        """Lock the joints that follow a joint that does not move."""
        for joint in self._robot.joints if not self._choice.uncoupled else ():
            leader, ratio, offset = self._resolve_leader(joint)
            if leader.kind == "fixed" or leader.name in self._locked or not ratio:
                value = ratio * self._locked.get(leader.name, 0.0) + offset
                if joint is not leader and leader.kind == "fixed":
                    self._warnings.append(
                        f"{joint.name} follows {leader.name}, which is fixed, and so is locked at {value:g}"
                    )
                if joint is not leader:
                    self._locked.setdefault(joint.name, value)

    def _list_couplings(self, bodies: list[ImportedBody]) -> tuple[Coupling, ...]:
        """Return the couplings between moving bodies."""
        moved = {body.limits.name: body for body in bodies if body.limits is not None}
        result = []
        for name, follower in moved.items():
            leader, ratio, offset = self._resolve_leader(self._joints[name])
            if leader.name == name:
                continue
            if leader.name in moved:
                result.append(Coupling(moved[leader.name], follower, ratio, offset))
                text = f"{ratio:g} times {leader.name}" + (f" plus {offset:g}" if offset else "")
                self._warnings.append(f"{name} is {text}, as in the file; --uncouple lets it move")
            else:
                self._warnings.append(
                    f"{name} follows {leader.name}, which is not here: it moves on its own"
                )
        return tuple(result)


def _parse_closure(text: str) -> ImportedClosure:
    """Return the closure that a text such as ``A=B`` or ``A=B:revolute`` asks for."""
    pair, _, kind = text.partition(":")
    one, _, other = (part.strip() for part in pair.partition("="))
    return ImportedClosure(
        f"{one}_{other}", CLOSED_KINDS[kind or "fixed"], (one, other), (np.eye(4), np.eye(4))
    )


def _order_bodies(bodies: Iterable[ImportedBody]) -> list[ImportedBody]:
    """Return the bodies in the file's order, each after the body that carries it."""
    left = list(bodies)
    by_parent: dict[str, list[ImportedBody]] = {}
    for body in left:
        by_parent.setdefault(body.parent, []).append(body)
    result: list[ImportedBody] = []
    waiting = list(by_parent.get(BASE, []))
    while waiting:
        body = waiting.pop()
        result.append(body)
        waiting += by_parent.get(body.name, [])
    return result


def _to_steps(joint: ImportedJoint, value: float) -> Steps:
    """Return the steps of a joint that stays at one coordinate."""
    if joint.kind in ("fixed", "floating", "planar") or value == 0:
        return ()
    if joint.kind == "prismatic":
        return (("xyz", tuple(value * x for x in joint.axis)),)
    axis = np.array(joint.axis)
    for k, key in enumerate(("rx", "ry", "rz")):
        if abs(axis[k]) == 1.0:
            return ((key, value * float(axis[k])),)
    rotation = rotate_z_to(axis)
    frame = np.eye(4)
    frame[:3, :3] = rotation
    return (*decompose_transform(frame), ("rz", value), *decompose_transform(frame.T))


class _Names:
    """The names of links, joints and closures, made valid for configs and unique."""

    def __init__(self, warnings: list[str]) -> None:
        self._warnings = warnings
        self._bodies: dict[str, str] = {BASE: BASE}
        self._coordinates: dict[str, str] = {}
        self._closures: dict[str, str] = {}

    def name_body(self, link: str) -> str:
        return self._make_unique(link, self._bodies, "link")

    def name_closure(self, name: str) -> str:
        return self._make_unique(name, self._closures, "closure")

    def name_coordinate(self, joint: str) -> str:
        return self._make_unique(joint, self._coordinates, "joint")

    def _make_unique(self, name: str, taken: dict[str, str], kind: str) -> str:
        """Return a valid, unique name, and note a warning if it differs from the given name."""
        own = self.clean(name) or kind
        while own in taken:
            own += "_"
        taken[own] = name
        if own != name:
            self._warnings.append(f"the {kind} {name!r} is called {own} here")
        return own

    def clean(self, name: str) -> str:
        """Return a name with only those characters that configs allow."""
        return re.sub(r"^[_.-]+", "", re.sub(r"[^A-Za-z0-9_.-]", "_", name))
