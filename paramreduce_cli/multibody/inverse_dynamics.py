"""Symbolic inverse dynamics by the recursive Newton-Euler method.

The recursion of [Luh1980] in body frames, with first moments and inertias about the frame
origins, so that the torques are linear in the standard parameters [Khosla1985]. It is written as
in a textbook: what has few operations is made by :mod:`paramreduce_cli.lean`.
"""

from dataclasses import dataclass

import casadi as ca

from paramreduce_cli.expressions.vectors import Matrix, Vector, add, apply, cross, dot, scale
from paramreduce_cli.multibody.drive_dynamics import CASADI, express_unit_force
from paramreduce_cli.multibody.drive_motions import (
    express_weighted_sum,
    make_motion_function,
    split_motion,
)
from paramreduce_cli.multibody.kinematics import JointMotion, make_joint_motions
from paramreduce_cli.records import BASE, INERTIAL, Mechanism, Rigid

ZERO: Vector = (ca.SX(0), ca.SX(0), ca.SX(0))


@dataclass(frozen=True)
class FrameRates:
    """The velocity and acceleration of a frame, in its own components."""

    omega: Vector
    """Angular velocity, rad/s."""
    omega_dot: Vector
    """Angular acceleration, rad/s^2."""
    acceleration: Vector
    """Acceleration of the origin, less gravity, m/s^2."""

    def accelerate_point(self, r: Vector) -> Vector:
        """Return the acceleration of a point that is fixed in the frame at r."""
        swing = add(cross(self.omega_dot, r), cross(self.omega, cross(self.omega, r)))
        return add(self.acceleration, swing)


def express_torques(
    mechanism: Mechanism, q: ca.SX, dq: ca.SX, ddq: ca.SX, phi: ca.SX
) -> list[ca.SX]:
    """Return the joint torques and forces of the open tree for a motion, as expressions.

    Args:
        mechanism: The tree; its loops are left open.
        q: Generalised coordinates, (n_q,), rad or m.
        dq: Velocities.
        ddq: Accelerations.
        phi: Parameters, (n_parameters,).

    Returns:
        One expression per joint, N m or N.
    """
    tau = _express_body_torques(mechanism, q, dq, ddq, phi)
    vectors = (q, dq, ddq, express_nominal_gravity(mechanism, q))
    *states, gravity = [[x[i] for i in range(mechanism.n_q)] for x in vectors]
    for drive in mechanism.drives:
        motion = express_weighted_sum(drive, states)
        if drive.between is not None:
            motion = split_motion(
                ca.vertsplit(make_motion_function(mechanism, drive.between)(q, dq))
            )
        for kind, column in mechanism.find_drive_columns(drive).items():
            along = phi[column] * express_unit_force(kind, drive, motion, gravity, CASADI)
            tau = [t + weight * along for t, weight in zip(tau, motion.weights, strict=True)]
    return tau


def express_nominal_gravity(mechanism: Mechanism, q: ca.SX) -> ca.SX:
    """Return the torques of gravity that the nominal parameters have, (n_q,); zero if there are none."""
    still = ca.SX(mechanism.n_q, 1)
    if mechanism.nominal is None:
        return still
    nominal = ca.SX(ca.DM(mechanism.nominal))
    return ca.vertcat(*_express_body_torques(mechanism, q, still, still, nominal))


def _express_body_torques(
    mechanism: Mechanism, q: ca.SX, dq: ca.SX, ddq: ca.SX, phi: ca.SX
) -> list[ca.SX]:
    """Return the torques and forces of the joints that the bodies and payloads need for a motion, without drives."""
    joints = make_joint_motions(mechanism, q)
    rates = _propagate_rates(mechanism, joints, dq, ddq)
    forces, moments = [ZERO] * mechanism.n_q, [ZERO] * mechanism.n_q
    tau = [ca.SX(0)] * mechanism.n_q
    for i in reversed(range(mechanism.n_q)):
        force, moment = forces[i], moments[i]
        for rigid in mechanism.list_rigid_parts(i):
            own_force, own_moment = _express_inertial_wrench(rigid, phi, rates[i])
            force, moment = add(force, own_force), add(moment, own_moment)
        tau[i] = _project_on_joint(joints[i], force, moment)
        parent = mechanism.bodies[i].parent
        if parent != BASE:
            force, moment = joints[i].to_parent(force), joints[i].to_parent(moment)
            forces[parent] = add(forces[parent], force)
            moments[parent] = add(moments[parent], add(moment, cross(joints[i].origin, force)))
    return tau


def _propagate_rates(
    mechanism: Mechanism, joints: list[JointMotion], dq: ca.SX, ddq: ca.SX
) -> list[FrameRates]:
    """Return the velocities and accelerations of all frames, from the base outwards."""
    x, y, z = (-mechanism.gravity).tolist()
    base = FrameRates(ZERO, ZERO, (ca.SX(x), ca.SX(y), ca.SX(z)))
    result: list[FrameRates] = []
    for i, joint in enumerate(joints):
        body = joint.body
        before = base if body.parent == BASE else result[body.parent]
        omega, omega_dot = joint.to_body(before.omega), joint.to_body(before.omega_dot)
        axis = joint.get_axis()
        if body.joint == "revolute":
            spin = scale(dq[i], axis)
            omega_dot = add(omega_dot, add(scale(ddq[i], axis), cross(omega, spin)))
            omega = add(omega, spin)
            hinge = joint.to_body(before.accelerate_point(joint.get_origin()))
            acceleration = FrameRates(omega, omega_dot, hinge).accelerate_point(joint.get_arm())
        else:
            sliding = add(scale(ddq[i], axis), scale(2 * dq[i], cross(omega, axis)))
            acceleration = add(joint.to_body(before.accelerate_point(joint.origin)), sliding)
        result.append(FrameRates(omega, omega_dot, acceleration))
    return result


def _express_inertial_wrench(rigid: Rigid, phi: ca.SX, rates: FrameRates) -> tuple[Vector, Vector]:
    """Return the force and the moment, about the origin of the carrying body, that a rigid part needs for its motion."""
    rotation, place = rigid.frame[:3, :3], rigid.frame[:3, 3].tolist()
    to_body = rotation.T.tolist()
    own = FrameRates(
        apply(to_body, rates.omega),
        apply(to_body, rates.omega_dot),
        apply(to_body, rates.accelerate_point(place)),
    )
    force, moment = _express_body_wrench(rigid, phi, own)
    force, moment = apply(rotation.tolist(), force), apply(rotation.tolist(), moment)
    return force, add(moment, cross(place, force))


def _express_body_wrench(rigid: Rigid, phi: ca.SX, rates: FrameRates) -> tuple[Vector, Vector]:
    """Return the force and the moment, about the origin of the part's own frame and in that frame, that a rigid part
    needs for its motion.
    """
    values = [phi[column] for column in (rigid.columns[kind] for kind in INERTIAL)]
    m, d, (xx, xy, xz, yy, yz, zz) = values[0], values[1:4], values[4:]
    tensor: Matrix = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
    omega, omega_dot, a = rates.omega, rates.omega_dot, rates.acceleration
    swing = add(cross(omega_dot, d), cross(omega, cross(omega, d)))
    spin = add(apply(tensor, omega_dot), cross(omega, apply(tensor, omega)))
    return add(scale(m, a), swing), add(spin, cross(d, a))


def _project_on_joint(joint: JointMotion, force: Vector, moment: Vector) -> ca.SX:
    """Return the component of a wrench about the body's origin along the joint."""
    if joint.body.joint == "prismatic":
        return dot(joint.get_axis(), force)
    return dot(joint.get_axis(), add(moment, cross(joint.get_arm(), force)))


def express_mass_matrix_and_bias(
    mechanism: Mechanism, q: ca.SX, dq: ca.SX, phi: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Return the mass matrix and the bias forces of the open tree, from its inverse dynamics.

    Returns:
        M = d tau / d ddq, (n_q, n_q), and delta = tau at ddq = 0, (n_q,), with
        tau = M ddq + delta.
    """
    ddq = ca.SX.sym("ddq", mechanism.n_q)
    tau = ca.vertcat(*express_torques(mechanism, q, dq, ddq, phi))
    return ca.jacobian(tau, ddq), ca.substitute(tau, ddq, ca.SX.zeros(mechanism.n_q))
