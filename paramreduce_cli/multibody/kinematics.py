"""Rotations and positions along the tree, symbolically and in numbers.

Small symbolic vectors are tuples of scalars: products with the zeros and ones of the
geometry then vanish as they are formed, instead of being simplified afterwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from paramreduce_cli.records import BASE, Body, FloatArray, Mechanism

Vector = tuple[ca.SX, ca.SX, ca.SX]
Matrix = tuple[Vector, Vector, Vector]
"""Rows of a 3 x 3 matrix."""

_QUARTER_TOLERANCE = 1e-14

ZERO: Vector = (ca.SX(0), ca.SX(0), ca.SX(0))


def add(a: Vector, b: Vector) -> Vector:
    """A + b"""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def subtract(a: Vector, b: Vector) -> Vector:
    """A - b"""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scale(factor: ca.SX, a: Vector) -> Vector:
    """Factor * a"""
    return (factor * a[0], factor * a[1], factor * a[2])


def dot(a: Sequence, b: Vector) -> ca.SX:
    """A . b"""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Sequence, b: Sequence) -> Vector:
    """A x b"""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def apply(matrix: Sequence[Sequence], a: Vector) -> Vector:
    """Matrix @ a"""
    return (dot(matrix[0], a), dot(matrix[1], a), dot(matrix[2], a))


@dataclass(frozen=True)
class JointMotion:
    """How vectors move between a body's frame and its parent's, at one coordinate.

    Rotations are applied factor by factor, which costs fewer operations than their product.
    """

    body: Body
    cosine: ca.SX
    sine: ca.SX
    origin: Vector
    """Of the body's frame, in the parent's frame, m."""

    def to_body(self, a: Vector) -> Vector:
        """Components in the body's frame of a vector given in the parent's."""
        x, y, z = apply(self.body.before[:3, :3].T.tolist(), a)
        turned = (self.cosine * x + self.sine * y, self.cosine * y - self.sine * x, z)
        return apply(self.body.after[:3, :3].T.tolist(), turned)

    def to_parent(self, a: Vector) -> Vector:
        """Components in the parent's frame of a vector given in the body's."""
        x, y, z = apply(self.body.after[:3, :3].tolist(), a)
        turned = (self.cosine * x - self.sine * y, self.cosine * y + self.sine * x, z)
        return apply(self.body.before[:3, :3].tolist(), turned)

    def axis(self) -> Vector:
        """The joint's axis in the body's frame."""
        x, y, z = self.body.after[2, :3].tolist()
        return (ca.SX(x), ca.SX(y), ca.SX(z))

    def arm(self) -> Vector:
        """From a fixed point of the joint's axis to the body's origin, in the body's frame, m."""
        offset = self.body.after[:3, :3].T @ self.body.after[:3, 3]
        return (ca.SX(offset[0]), ca.SX(offset[1]), ca.SX(offset[2]))


def joint_motion(body: Body, z: ca.SX) -> JointMotion:
    """The motion of one joint at coordinate ``z``."""
    if body.joint == "revolute":
        (c, s), slide = _cosine_and_sine(z, body.offset), ca.SX(0)
    else:
        c, s, slide = ca.SX(1), ca.SX(0), z + body.offset
    after = body.after[:3, 3].tolist()
    moved = (c * after[0] - s * after[1], s * after[0] + c * after[1], after[2] + slide)
    base = body.before[:3, 3].tolist()
    origin = add(
        (ca.SX(base[0]), ca.SX(base[1]), ca.SX(base[2])),
        apply(body.before[:3, :3].tolist(), moved),
    )
    return JointMotion(body, c, s, origin)


def _cosine_and_sine(z: ca.SX, offset: float) -> tuple[ca.SX, ca.SX]:
    """Of z + offset; whole quarter turns cost nothing and are exact."""
    quarters = round(offset / (np.pi / 2))
    if abs(offset - quarters * np.pi / 2) > _QUARTER_TOLERANCE:
        return ca.cos(z + offset), ca.sin(z + offset)
    c, s = ca.cos(z), ca.sin(z)
    for _ in range(quarters % 4):
        c, s = -s, c
    return c, s


def motions(mechanism: Mechanism, q: ca.SX) -> list[JointMotion]:
    """One motion per body at the generalised coordinates ``q`` (n_q,)."""
    return [joint_motion(body, q[i]) for i, body in enumerate(mechanism.bodies)]


def point_in_base(joints: list[JointMotion], body: int, point: FloatArray) -> Vector:
    """Position in the base frame of a point given in the frame of a body, m.

    Args:
        joints: One motion per body of the mechanism.
        body: Index of the body, :data:`BASE` for the base.
        point: (3,), m
    """
    x, y, z = np.asarray(point).tolist()
    position: Vector = (ca.SX(x), ca.SX(y), ca.SX(z))
    while body != BASE:
        position = add(joints[body].origin, joints[body].to_parent(position))
        body = joints[body].body.parent
    return position


def direction_in_base(joints: list[JointMotion], body: int, direction: FloatArray) -> Vector:
    """Components in the base frame of a direction given in the frame of a body."""
    x, y, z = np.asarray(direction).tolist()
    components: Vector = (ca.SX(x), ca.SX(y), ca.SX(z))
    while body != BASE:
        components = joints[body].to_parent(components)
        body = joints[body].body.parent
    return components


def body_poses(mechanism: Mechanism, q: FloatArray) -> FloatArray:
    """Poses of the body frames in the base frame.

    Args:
        mechanism: Whose bodies are placed.
        q: Generalised coordinates of one state, (n_q,), rad or m.

    Returns:
        Homogeneous transforms, (n_bodies, 4, 4).
    """
    poses: list[FloatArray] = []
    for body, value in zip(mechanism.bodies, q, strict=True):
        motion = np.eye(4)
        moved = value + body.offset
        if body.joint == "revolute":
            c, s = np.cos(moved), np.sin(moved)
            motion[:2, :2] = [[c, -s], [s, c]]
        else:
            motion[2, 3] = moved
        local = body.before @ motion @ body.after
        poses.append(local if body.parent == BASE else poses[body.parent] @ local)
    return np.array(poses)
