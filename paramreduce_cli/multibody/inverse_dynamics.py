"""Inverse dynamics by the recursive Newton-Euler method, symbolically.

The recursion of [Luh1980] in body frames, with first moments and inertias about the frame
origins, so that the torques are linear in the standard parameters [Khosla1985]. The matrix
U = skew(w') + skew(w)^2 is formed once a body and serves both force and moment
[Khalil1987]. The mass of a body whose origin is on its hinge's axis moves as a point of the
body before, so its force is formed there and is not turned back and forth.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from paramreduce_cli.multibody.kinematics import (
    ZERO,
    JointMotion,
    Matrix,
    Vector,
    add,
    apply,
    cross,
    dot,
    motions,
    scale,
)
from paramreduce_cli.records import BASE, PARAMETER_KINDS, Mechanism


@dataclass(frozen=True)
class BodyInertia:
    """The standard parameters of one body as symbols or expressions."""

    m: ca.SX
    moment: Vector
    """First moment m r, kg m."""
    tensor: Matrix
    """Inertia about the frame origin, kg m^2."""


def body_inertias(mechanism: Mechanism, phi: ca.SX) -> list[BodyInertia]:
    """The parameters of every body in the stacked vector ``phi``; zeros where it has no mass."""
    count = len(PARAMETER_KINDS)
    order = {body: position for position, body in enumerate(mechanism.inertial)}
    result = []
    for i in range(mechanism.n_q):
        own = range(count * order[i], count * (order[i] + 1)) if i in order else None
        values = [ca.SX(0)] * count if own is None else [phi[k] for k in own]
        m, mx, my, mz, xx, xy, xz, yy, yz, zz = values
        result.append(BodyInertia(m, (mx, my, mz), ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))))
    return result


@dataclass(frozen=True)
class BodyMotion:
    """Velocity and acceleration of one body frame, in its own components."""

    joint: JointMotion
    omega: Vector
    omega_dot: Vector
    acceleration: Vector
    """Of the origin, less gravity."""
    before: Vector
    """Acceleration of the joint's place on the body before, in that one's components."""
    U: Matrix
    """skew(omega_dot) + skew(omega)^2"""


def inverse_dynamics(
    mechanism: Mechanism, q: ca.SX, dq: ca.SX, ddq: ca.SX, phi: ca.SX, *, gravity: bool = True
) -> list[ca.SX]:
    """Joint torques and forces of the open tree for a motion.

    Args:
        mechanism: The tree; its loops are left open.
        q: Generalised coordinates, (n_q,), rad or m.
        dq: Velocities.
        ddq: Accelerations.
        phi: Standard parameters, (n_parameters,).
        gravity: Whether gravity acts.

    Returns:
        One expression per joint, N m or N.
    """
    moving = body_motions(mechanism, motions(mechanism, q), dq, ddq, gravity=gravity)
    forces: list[Vector] = []
    moments: list[Vector] = []
    loads = [ZERO] * len(moving)
    for i, inertia in enumerate(body_inertias(mechanism, phi)):
        force, moment = inertial_wrench(inertia, moving[i])
        place = _hinge_that_carries(mechanism, moving, i)
        if place is None:
            force = add(force, scale(inertia.m, moving[i].acceleration))
        else:
            loads[place] = add(loads[place], scale(inertia.m, moving[place].before))
        forces.append(force)
        moments.append(moment)
    return transmit(mechanism, [m.joint for m in moving], forces, moments, loads)


def _hinge_that_carries(mechanism: Mechanism, moving: list[BodyMotion], body: int) -> int | None:
    """The hinge nearest to the base whose place is a body's origin; None if it has none."""
    found = None
    while _turns_in_place(moving[body].joint) and mechanism.bodies[body].parent != BASE:
        found = body
        if any(not component.is_zero() for component in moving[body].joint.origin):
            break
        body = mechanism.bodies[body].parent
    return found


def _turns_in_place(joint: JointMotion) -> bool:
    return joint.body.joint == "revolute" and all(part.is_zero() for part in joint.arm())


def body_motions(
    mechanism: Mechanism, joints: list[JointMotion], dq: ca.SX, ddq: ca.SX, *, gravity: bool
) -> list[BodyMotion]:
    """Propagate velocities and accelerations from the base outwards."""
    down = (-mechanism.gravity).tolist() if gravity else [0.0, 0.0, 0.0]
    ground = (ca.SX(down[0]), ca.SX(down[1]), ca.SX(down[2]))
    result: list[BodyMotion] = []
    for i, joint in enumerate(joints):
        body = joint.body
        if body.parent == BASE:
            omega, omega_dot, acceleration = ZERO, ZERO, ground
        else:
            before = result[body.parent]
            omega, omega_dot = before.omega, before.omega_dot
            acceleration = add(before.acceleration, apply(before.U, joint.origin))
        place = acceleration
        omega, omega_dot, acceleration = map(joint.to_body, (omega, omega_dot, acceleration))
        axis = joint.axis()
        if body.joint == "revolute":
            turning = scale(dq[i], axis)
            rise = add(scale(ddq[i], axis), cross(omega, turning))
            acceleration = add(acceleration, _swing(joint, omega, omega_dot, turning, rise))
            omega, omega_dot = add(omega, turning), add(omega_dot, rise)
        else:
            acceleration = add(acceleration, scale(ddq[i], axis))
            acceleration = add(acceleration, scale(2 * dq[i], cross(omega, axis)))
        result.append(
            BodyMotion(joint, omega, omega_dot, acceleration, place, _u_matrix(omega, omega_dot))
        )
    return result


def _swing(
    joint: JointMotion, omega: Vector, omega_dot: Vector, turning: Vector, rise: Vector
) -> Vector:
    """What the joint's own turning adds to the acceleration of a frame off its axis."""
    arm = joint.arm()
    if all(component.is_zero() for component in arm):
        return ZERO
    before = apply(_u_matrix(omega, omega_dot), arm)
    after = apply(_u_matrix(add(omega, turning), add(omega_dot, rise)), arm)
    return (after[0] - before[0], after[1] - before[1], after[2] - before[2])


def _u_matrix(omega: Vector, omega_dot: Vector) -> Matrix:
    xx, yy, zz = (component * component for component in omega)
    xy, xz, yz = omega[0] * omega[1], omega[0] * omega[2], omega[1] * omega[2]
    return (
        (-yy - zz, xy - omega_dot[2], xz + omega_dot[1]),
        (xy + omega_dot[2], -xx - zz, yz - omega_dot[0]),
        (xz - omega_dot[1], yz + omega_dot[0], -xx - yy),
    )


def inertial_wrench(inertia: BodyInertia, motion: BodyMotion) -> tuple[Vector, Vector]:
    """Force and moment about the frame origin that keep the body on its motion.

    The force is without that of the mass at the origin, m a. The moment is I w' + w x (I w) + d x a with the products of w taken from U.
    """
    U, rate, omega = motion.U, motion.omega_dot, motion.omega
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia.tensor
    force = apply(U, inertia.moment)
    spin = (
        xx * rate[0] + (zz - yy) * (omega[1] * omega[2]) - xy * U[2][0] + xz * U[1][0]
        + yz * (U[1][1] - U[2][2]),
        yy * rate[1] + (xx - zz) * (omega[0] * omega[2]) + xy * U[2][1] - yz * U[0][1]
        + xz * (U[2][2] - U[0][0]),
        zz * rate[2] + (yy - xx) * (omega[0] * omega[1]) - xz * U[1][2] + yz * U[0][2]
        + xy * (U[0][0] - U[1][1]),
    )  # fmt: skip
    return force, add(spin, cross(inertia.moment, motion.acceleration))


def transmit(
    mechanism: Mechanism,
    joints: list[JointMotion],
    forces: list[Vector],
    moments: list[Vector],
    loads: list[Vector],
) -> list[ca.SX]:
    """Add up wrenches from the tips inwards and project them on the joint axes.

    Args:
        mechanism: The tree.
        joints: One per body.
        forces: On each body, in its own components; overwritten.
        moments: About each body's origin, in its own components; overwritten.
        loads: At each joint's place on the body before, in that one's components.

    Returns:
        One torque or force per joint.
    """
    tau = [ca.SX(0)] * mechanism.n_q
    for i in reversed(range(mechanism.n_q)):
        joint = joints[i]
        axis = joint.axis()
        if joint.body.joint == "revolute":
            about_axis = add(moments[i], cross(joint.arm(), forces[i]))
            tau[i] = dot(axis, about_axis)
        else:
            tau[i] = dot(axis, forces[i])
        parent = joint.body.parent
        if parent != BASE:
            force = add(joint.to_parent(forces[i]), loads[i])
            moment = add(joint.to_parent(moments[i]), cross(joint.origin, force))
            forces[parent] = add(forces[parent], force)
            moments[parent] = add(moments[parent], moment)
    return tau
