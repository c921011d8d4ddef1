"""From what a config says of the mechanism to records; shared by the stages."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from paramreduce_cli.config import Config
from paramreduce_cli.config.description import DHDescription, Step, TreeDescription
from paramreduce_cli.config.schema import ConstraintSection
from paramreduce_cli.multibody.assembly import assembled
from paramreduce_cli.records import BASE, Constraint, FloatArray, Mechanism
from paramreduce_cli.robots.closed_loop import LoopClosure, TreeBody, mechanism_from_bodies
from paramreduce_cli.robots.dh import DHRow, mechanism_from_dh
from paramreduce_cli.robots.frames import rotation_x, rotation_y, rotation_z, translation

Stretch = Callable[[float], float]
"""Changes a length, to see what follows from the structure and what from the numbers."""


def described_mechanism(config: Config, stretch: Stretch = lambda length: length) -> Mechanism:
    """The mechanism of a config, its loops closed.

    Args:
        config: Of the robot.
        stretch: Applied to the lengths of a Denavit-Hartenberg table.

    Raises:
        ConfigError: The loops cannot be closed or do not make sense.
    """
    description = config.description
    if description.dh is not None:
        rows = _dh_rows(description.dh, config.body_names(), stretch)
        return mechanism_from_dh(config.robot, rows, description.dh.convention, description.gravity)
    assert description.tree is not None
    return assembled(_from_tree(config.robot, description.tree, description.gravity))


def _dh_rows(dh: DHDescription, names: Sequence[str], stretch: Stretch) -> list[DHRow]:
    return [
        DHRow(
            name=names[k],
            parent=_parent(joint.parent, names[k - 1] if k else None),
            joint=joint.type,
            a=stretch(joint.a),
            alpha=joint.alpha,
            d=stretch(joint.d),
            theta=joint.theta,
            gamma=joint.gamma,
            b=stretch(joint.b),
        )
        for k, joint in enumerate(dh.joints)
    ]


def _parent(given: str | None, above: str | None) -> str | None:
    if given == "base":
        return None
    return given if given is not None else above


def _from_tree(robot: str, tree: TreeDescription, gravity: Sequence[float]) -> Mechanism:
    rows = [
        TreeBody(
            name=body.name,
            parent=_named(body.parent),
            joint=body.joint,
            axes=tuple((axis[0], axis[1], axis[2]) for axis in body.axes),
            placement=placement(body.at),
            coordinates=tuple(body.coordinate_names()),
            massless=body.massless,
        )
        for body in tree.bodies
    ]
    closures = [
        LoopClosure(
            name=closure.name or f"loop_{k + 1}",
            kind=closure.type,
            bodies=(_named(closure.bodies[0]), _named(closure.bodies[1])),
            frames=(placement(closure.at[0]), placement(closure.at[1])),
            length=closure.length or 0.0,
        )
        for k, closure in enumerate(tree.closures)
    ]
    return mechanism_from_bodies(robot, rows, gravity, closures, tree.independent, tree.guess)


def _named(body: str) -> str | None:
    """None for the base."""
    return None if body == "base" else body


def placement(steps: Sequence[Step]) -> FloatArray:
    """Steps one after the other as a homogeneous transform, (4, 4)."""
    turns = {"rx": rotation_x, "ry": rotation_y, "rz": rotation_z}
    result = np.eye(4)
    for step in steps:
        if step.xyz is not None:
            result = result @ translation(*step.xyz)
        for key, turn in turns.items():
            angle = getattr(step, key)
            if angle is not None:
                result = result @ turn(angle)
    return result


def described_constraints(config: Config, mechanism: Mechanism) -> tuple[Constraint, ...]:
    """Bounds on quantities of the mechanism along the trajectories."""
    bodies = {body.name: k for k, body in enumerate(mechanism.bodies)} | {"base": BASE}
    names = mechanism.generalised_names

    def constraint(entry: ConstraintSection) -> Constraint:
        owners: list[int] = []
        vectors: list[list[float]] = []
        if entry.quantity == "coordinate":
            owners = [names.index(entry.coordinate or "")]
        elif entry.quantity == "distance-from-axis":
            owners = [bodies[entry.body or ""], bodies[entry.axis_body]]
            vectors = [entry.point, entry.axis_point, entry.axis]
        elif entry.quantity in ("angle", "distance"):
            owners = [bodies[name] for name in entry.bodies or []]
            vectors = entry.axes if entry.quantity == "angle" else entry.points
        return Constraint(
            name=entry.name,
            kind=entry.quantity,
            bodies=tuple(owners),
            vectors=tuple(np.array(vector) for vector in vectors),
            lower=-np.inf if entry.min is None else entry.min,
            upper=np.inf if entry.max is None else entry.max,
        )

    return tuple(constraint(entry) for entry in config.trajectories.constraints)
