"""Force elements by vector mechanics on Pinocchio's positions, velocities and Jacobians of points."""

import numpy as np
import pinocchio as pin

from oracles.pinocchio_model import build
from paramreduce_cli.records import BASE

_UNIT = [1.0, 0, 0, 0, 1, 0, 0, 1, 0, 1]


class Kinematics:
    """Frames of a mechanism's bodies at one state."""

    def __init__(self, mechanism, q, dq):
        self._mechanism, self._dq = mechanism, dq
        phi = np.tile(_UNIT, len(mechanism.bodies))
        self._model, self._data, offsets = build(mechanism, phi)
        pin.computeJointJacobians(self._model, self._data, q + offsets)
        pin.updateFramePlacements(self._model, self._data)

    def frame(self, body, local):
        """Homogeneous transform of a frame on a body in the base frame."""
        if body == BASE:
            return local
        at = self._data.oMi[body + 1].homogeneous @ self._mechanism.bodies[body].joint_to_body
        return at @ local

    def jacobian(self, body, point):
        """Velocity of the body's material point that is at a place in the base frame, and the angular one, by dq."""
        n = len(self._dq)
        if body == BASE:
            return np.zeros((3, n)), np.zeros((3, n))
        J = pin.getJointJacobian(self._model, self._data, body + 1, pin.ReferenceFrame.WORLD)
        linear, angular = J[:3], J[3:]
        return linear - pin.skew(point) @ angular, angular


def line(mechanism, q, dq, between):
    """Length, its rate, and the torques that a unit force needs which pulls the points together."""
    k = Kinematics(mechanism, q, dq)
    A, B = (k.frame(*pair) for pair in zip(between.bodies, between.frames, strict=True))
    gap = B[:3, 3] - A[:3, 3]
    along = gap / np.linalg.norm(gap)
    J_a, _ = k.jacobian(between.bodies[0], A[:3, 3])
    J_b, _ = k.jacobian(between.bodies[1], B[:3, 3])
    needed = (J_b - J_a).T @ along
    return np.linalg.norm(gap), needed @ dq, needed


def shift(mechanism, q, dq, between):
    """Displacement along an axis of A, its rate, and the torques that a unit force along the axis needs.

    The force on A acts where B is, because A's axis turns with A.
    """
    k = Kinematics(mechanism, q, dq)
    A, B = (k.frame(*pair) for pair in zip(between.bodies, between.frames, strict=True))
    axis = A[:3, between.axis]
    J_a, _ = k.jacobian(between.bodies[0], B[:3, 3])
    J_b, _ = k.jacobian(between.bodies[1], B[:3, 3])
    needed = (J_b - J_a).T @ axis
    return axis @ (B[:3, 3] - A[:3, 3]), needed @ dq, needed


def wheel(mechanism, q, dq, between):
    """Slip, side slip, and the torques that a unit force against each needs."""
    k = Kinematics(mechanism, q, dq)
    road, hub = (k.frame(*pair) for pair in zip(between.bodies, between.frames, strict=True))
    normal, axle = road[:3, 2], hub[:3, 1]
    forward = np.cross(axle, normal)
    forward /= np.linalg.norm(forward)
    left = np.cross(normal, forward)
    contact = hub[:3, 3] - between.radius * normal
    J, _ = k.jacobian(between.bodies[1], contact)
    rolling = forward @ J
    speed = rolling @ dq
    if between.spin >= 0:
        rolling = rolling.copy()
        rolling[between.spin] -= between.radius
    across = left @ J
    divisor = np.hypot(speed, between.low_speed)
    return rolling @ dq / divisor, across @ dq / divisor, rolling, across
