"""The same mechanism in Pinocchio."""

import numpy as np
import pinocchio as pin

from paramreduce_cli.records import BASE


def build(mechanism, phi):
    """A Pinocchio model with the standard parameters ``phi``, and the offsets of its joints."""
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
        inertia = pin.Inertia.FromDynamicParameters(
            np.array([m, mx, my, mz, xx, xy, yy, xz, yz, zz])
        )
        model.appendBodyToJoint(joints[-1], inertia, pin.SE3(body.joint_to_body))
    offsets = np.array([body.offset for body in mechanism.bodies])
    return model, offsets


def inverse_dynamics(mechanism, phi, z, dz, ddz):
    model, offsets = build(mechanism, phi)
    data = model.createData()
    return np.array(
        [pin.rnea(model, data, a + offsets, b, c) for a, b, c in zip(z, dz, ddz, strict=True)]
    )


def mass_matrix_and_bias(mechanism, phi, z, dz):
    model, offsets = build(mechanism, phi)
    data = model.createData()
    M = [np.triu(pin.crba(model, data, a + offsets)) for a in z]
    M = [upper + np.triu(upper, 1).T for upper in M]
    bias = [pin.nonLinearEffects(model, data, a + offsets, b) for a, b in zip(z, dz, strict=True)]
    return np.array(M), np.array(bias)


def regressor(mechanism, z, dz, ddz):
    """Joint torque regressor, columns in this project's order; for body frames on joint frames."""
    model, offsets = build(mechanism, np.tile([1.0, 0, 0, 0, 1, 0, 0, 1, 0, 1], mechanism.n_dof))
    data = model.createData()
    ours = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]  # Pinocchio: m mx my mz Ixx Ixy Iyy Ixz Iyz Izz
    columns = np.concatenate([10 * k + np.array(ours) for k in range(mechanism.n_dof)])
    return np.array(
        [
            pin.computeJointTorqueRegressor(model, data, a + offsets, b, c)[:, columns]
            for a, b, c in zip(z, dz, ddz, strict=True)
        ]
    )
