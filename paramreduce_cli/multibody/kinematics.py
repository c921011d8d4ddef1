"""Rotations and positions along the tree, as expressions and as numbers."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from paramreduce_cli.expressions.vectors import Vector, add, apply
from paramreduce_cli.records import BASE, Body, FloatArray, Mechanism
from paramreduce_cli.robots.frames import count_right_angles


@dataclass(frozen=True)
class JointMotion:
    """A motion of one joint at a coordinate: it transforms vectors between a body's frame and its parent's.

    Rotations are applied factor by factor, which costs fewer operations than their product.
    """

    body: Body
    cosine: ca.SX
    sine: ca.SX
    origin: Vector
    """Origin of the body's frame, in the parent's frame, m."""

    def to_body(self, a: Vector) -> Vector:
        """Return the components in the body's frame of a vector given in the parent's."""
        x, y, z = apply(self.body.parent_to_joint[:3, :3].T.tolist(), a)
        turned = (self.cosine * x + self.sine * y, self.cosine * y - self.sine * x, z)
        return apply(self.body.joint_to_body[:3, :3].T.tolist(), turned)

    def to_parent(self, a: Vector) -> Vector:
        """Return the components in the parent's frame of a vector given in the body's."""
        x, y, z = apply(self.body.joint_to_body[:3, :3].tolist(), a)
        turned = (self.cosine * x - self.sine * y, self.cosine * y + self.sine * x, z)
        return apply(self.body.parent_to_joint[:3, :3].tolist(), turned)

    def get_axis(self) -> Vector:
        """Return the joint's axis in the body's frame."""
        x, y, z = self.body.joint_to_body[2, :3].tolist()
        return (ca.SX(x), ca.SX(y), ca.SX(z))

    def get_origin(self) -> Vector:
        """Return the joint's origin at rest in the parent's frame, m."""
        x, y, z = self.body.parent_to_joint[:3, 3].tolist()
        return (ca.SX(x), ca.SX(y), ca.SX(z))

    def get_arm(self) -> Vector:
        """Return the constant vector from the origin of the joint's frame, which moves with the body, to the body's
        origin, in the body's frame, m.
        """
        offset = self.body.joint_to_body[:3, :3].T @ self.body.joint_to_body[:3, 3]
        return (ca.SX(offset[0]), ca.SX(offset[1]), ca.SX(offset[2]))


def make_joint_motion(body: Body, z: ca.SX) -> JointMotion:
    """Return the motion of one joint at coordinate ``z``."""
    if body.joint == "revolute":
        (c, s), slide = express_cosine_and_sine(z, body.offset), ca.SX(0)
    else:
        c, s, slide = ca.SX(1), ca.SX(0), z + body.offset
    after = body.joint_to_body[:3, 3].tolist()
    moved = (c * after[0] - s * after[1], s * after[0] + c * after[1], after[2] + slide)
    base = body.parent_to_joint[:3, 3].tolist()
    origin = add(
        (ca.SX(base[0]), ca.SX(base[1]), ca.SX(base[2])),
        apply(body.parent_to_joint[:3, :3].tolist(), moved),
    )
    return JointMotion(body, c, s, origin)


def express_cosine_and_sine(z: ca.SX, offset: float) -> tuple[ca.SX, ca.SX]:
    """Return cosine and sine of z + offset; whole quarter turns are exact and cost no operations."""
    quarters = count_right_angles(offset)
    if quarters is None:
        return ca.cos(z + offset), ca.sin(z + offset)
    c, s = ca.cos(z), ca.sin(z)
    for _ in range(quarters % 4):
        c, s = -s, c
    return c, s


def make_joint_motions(mechanism: Mechanism, q: ca.SX) -> list[JointMotion]:
    """Return one motion per body at the generalised coordinates ``q``, (n_q,)."""
    return [make_joint_motion(body, q[i]) for i, body in enumerate(mechanism.bodies)]


def transform_point(
    joints: list[JointMotion], body: int, point: FloatArray, ancestor: int = BASE
) -> Vector:
    """Return the position in an ancestor's frame of a point given in the frame of a body, m.

    Args:
        joints: Motions of the joints, one for each body of the mechanism.
        body: Index of the body, :data:`BASE` for the base.
        point: Position in the body's frame, (3,), m.
        ancestor: Index of a body between the base and the body, or of the body itself; the base if left out.
    """
    x, y, z = np.asarray(point).tolist()
    position: Vector = (ca.SX(x), ca.SX(y), ca.SX(z))
    while body != ancestor:
        position = add(joints[body].origin, joints[body].to_parent(position))
        body = joints[body].body.parent
    return position


def transform_direction(
    joints: list[JointMotion], body: int, direction: FloatArray, ancestor: int = BASE
) -> Vector:
    """Return the components in an ancestor's frame of a direction given in the frame of a body.

    Args:
        joints: Motions of the joints, one for each body of the mechanism.
        body: Index of the body, :data:`BASE` for the base.
        direction: Components in the body's frame, (3,).
        ancestor: Index of a body between the base and the body, or of the body itself; the base if left out.
    """
    x, y, z = np.asarray(direction).tolist()
    components: Vector = (ca.SX(x), ca.SX(y), ca.SX(z))
    while body != ancestor:
        components = joints[body].to_parent(components)
        body = joints[body].body.parent
    return components


def compute_body_poses(mechanism: Mechanism, q: FloatArray) -> FloatArray:
    """Return the poses of the body frames in the base frame.

    Args:
        mechanism: Mechanism with the bodies.
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
        local = body.parent_to_joint @ motion @ body.joint_to_body
        poses.append(local if body.parent == BASE else poses[body.parent] @ local)
    return np.array(poses)
