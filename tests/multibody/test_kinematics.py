import numpy as np
import pinocchio as pin
from conftest import random_states
from oracles import pinocchio_model

from paramreduce_cli.multibody.kinematics import compute_body_poses


def test_poses_agree_with_pinocchio(mechanism):
    model, data, offsets = pinocchio_model.build(mechanism, np.ones(10 * mechanism.n_dof))
    for z in random_states(mechanism, 5)[0]:
        pin.forwardKinematics(model, data, z + offsets)
        found = compute_body_poses(mechanism, z)
        for k, body in enumerate(mechanism.bodies):
            expected = data.oMi[k + 1].homogeneous @ body.joint_to_body
            assert np.allclose(found[k], expected, atol=1e-13)
