"""The same mechanism in Pinocchio."""

import numpy as np
import pinocchio as pin

from paramreduce_cli.records import BASE


def build(mechanism, phi):
    """A Pinocchio model with the standard parameters ``phi``, its data and its joints' offsets."""
    model = pin.Model()
    model.gravity.linear = np.asarray(mechanism.gravity)
    joints = []
    for k, body in enumerate(mechanism.bodies):
        parent = 0 if body.parent == BASE else joints[body.parent]
        above = np.eye(4) if body.parent == BASE else mechanism.bodies[body.parent].joint_to_body
        joint = pin.JointModelRZ() if body.joint == "revolute" else pin.JointModelPZ()
        placement = pin.SE3(above @ body.parent_to_joint)
        joints.append(model.addJoint(parent, joint, placement, body.name))
        m, mx, my, mz, xx, xy, xz, yy, yz, zz = phi[10 * k : 10 * k + 10]
        dynamic = np.array([m, mx, my, mz, xx, xy, yy, xz, yz, zz])
        inertia = pin.Inertia.FromDynamicParameters(dynamic)
        model.appendBodyToJoint(joints[-1], inertia, pin.SE3(body.joint_to_body))
    return model, model.createData(), np.array([body.offset for body in mechanism.bodies])


def inverse_dynamics(mechanism, phi, z, dz, ddz):
    *model, offsets = build(mechanism, phi)
    states = zip(z + offsets, dz, ddz, strict=True)
    return np.array([pin.rnea(*model, *state) for state in states])


def mass_matrix_and_bias(mechanism, phi, z, dz):
    *model, offsets = build(mechanism, phi)
    upper = np.triu([pin.crba(*model, a) for a in z + offsets])
    bias = [pin.nonLinearEffects(*model, *state) for state in zip(z + offsets, dz, strict=True)]
    return upper + np.triu(upper, 1).transpose(0, 2, 1), np.array(bias)


def regressor(mechanism, z, dz, ddz):
    """Joint torque regressor, columns in this project's order; for body frames on joint frames."""
    *model, offsets = build(mechanism, np.tile([1.0, 0, 0, 0, 1, 0, 0, 1, 0, 1], mechanism.n_dof))
    ours = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]  # Pinocchio: m mx my mz Ixx Ixy Iyy Ixz Iyz Izz
    columns = np.add.outer(10 * np.arange(mechanism.n_dof), ours).ravel()
    states = zip(z + offsets, dz, ddz, strict=True)
    K = np.array([pin.computeJointTorqueRegressor(*model, *state) for state in states])
    return K[:, :, columns]
