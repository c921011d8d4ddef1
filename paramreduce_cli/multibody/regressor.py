"""Regressor of a tree: its torques as a linear map of its parameters.

In components of the base frame a joint sees the bodies beyond it only through its screw, and
a body is seen by all joints before it through one matrix: the force, and the moment about the
base's origin, that unit values of its parameters need [Atkeson1986]. Their products are all
there is, so that work and code grow no faster than the number of joints times that of parameters.
"""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from paramreduce_cli.multibody.drive_dynamics import CASADI, express_unit_force
from paramreduce_cli.multibody.drive_motions import (
    express_weighted_sum,
    make_motion_function,
    split_motion,
)
from paramreduce_cli.multibody.inverse_dynamics import express_nominal_gravity
from paramreduce_cli.multibody.kinematics import express_cosine_and_sine
from paramreduce_cli.records import BASE, INERTIAL, Body, FloatArray, Mechanism

_FLAT = 500
"""Entries of the regressor that are not always zero, up to which it is written out as scalars.
Such code is twice as fast; beyond, compilers take minutes over it, or gigabytes."""

_FrameState = tuple[ca.MX, ...]
"""Framestate of a frame in components of the base: rotation, origin, angular velocity and acceleration, and the acceleration of the origin less gravity."""


def express_regressor(mechanism: Mechanism, columns: Sequence[int] | None = None) -> ca.Function:
    """Return the regressor of an open tree.

    Args:
        mechanism: The tree; its loops are left open.
        columns: Indices of the requested parameters; all by default.

    Returns:
        A function of q, dq and ddq, each (n_q,), whose value is K', (n_columns, n_q), with
        tau = K phi.
    """
    parameters = list(range(mechanism.n_parameters)) if columns is None else list(columns)
    q, dq, ddq = (ca.MX.sym(name, mechanism.n_q) for name in ("q", "dq", "ddq"))
    states, screws = _propagate_states(mechanism, q, dq, ddq)
    wrench = _make_unit_wrenches()
    parts: list[ca.MX] = []
    order: list[int] = []
    for rigid in mechanism.rigid:
        present = {kind: c for kind, c in rigid.columns.items() if c in parameters}
        if present:
            state = _move_frame(states[rigid.body], rigid.frame)
            parts.append(wrench(*state)[:, [INERTIAL.index(kind) for kind in present]])
            order += present.values()
    inertial = sorted(order, key=parameters.index)
    wrenches = ca.horzcat(*parts)[:, [order.index(c) for c in inertial]] if parts else ca.MX(6, 0)
    reached = _find_carrying_joints(mechanism)
    maps = wrenches.T @ ca.horzcat(*screws) * ca.MX(ca.sparsify(ca.DM(reached[inertial])))
    driven = {
        c: row for c, row in _express_drive_rows(mechanism, q, dq, ddq).items() if c in parameters
    }
    rows = ca.vertcat(maps, *driven.values())
    place = {c: k for k, c in enumerate([*inertial, *driven])}
    function = ca.Function("regressor", [q, dq, ddq], [rows[[place[c] for c in parameters], :]])
    return function.expand() if reached[inertial].sum() <= _FLAT else function


def _express_drive_rows(mechanism: Mechanism, q: ca.MX, dq: ca.MX, ddq: ca.MX) -> dict[int, ca.MX]:
    """Return the rows of the drives' parameters, (1, n_q) each, by column."""
    at = ca.SX.sym("q", mechanism.n_q)
    gravity = ca.Function("gravity", [at], [express_nominal_gravity(mechanism, at)])(q)
    *states, loads = [[x[i] for i in range(mechanism.n_q)] for x in (q, dq, ddq, gravity)]
    rows = {}
    for drive in mechanism.drives:
        motion = express_weighted_sum(drive, states)
        weights = ca.MX(ca.sparsify(ca.DM(drive.weights[None])))
        if drive.between is not None:
            motion = split_motion(
                ca.vertsplit(make_motion_function(mechanism, drive.between)(q, dq))
            )
            weights = ca.horzcat(*motion.weights)
        for kind, column in mechanism.find_drive_columns(drive).items():
            rows[column] = express_unit_force(kind, drive, motion, loads, CASADI) * weights
    return rows


def _move_frame(state: _FrameState, frame: FloatArray) -> _FrameState:
    """Return the state of a frame that is fixed in another frame."""
    if np.array_equal(frame, np.eye(4)):
        return state
    R, p, omega, omega_dot, a = symbols = _make_frame_symbols()
    arm = R @ frame[:3, 3]
    moved = [
        R @ frame[:3, :3],
        p + arm,
        omega,
        omega_dot,
        a + _express_swing(omega, omega_dot, arm),
    ]
    return tuple(ca.Function("moved", symbols, moved).call(list(state)))


def _find_carrying_joints(mechanism: Mechanism) -> np.ndarray:
    """Return 1 where the body of a parameter is beyond a joint, (n_parameters, n_q)."""
    result = np.zeros((mechanism.n_parameters, mechanism.n_q))
    for rigid in mechanism.rigid:
        columns, joint = list(rigid.columns.values()), rigid.body
        while joint != BASE:
            result[columns, joint] = 1.0
            joint = mechanism.bodies[joint].parent
    return result


def _propagate_states(
    mechanism: Mechanism, q: ca.MX, dq: ca.MX, ddq: ca.MX
) -> tuple[list[_FrameState], list[ca.MX]]:
    """Return the states of the bodies' frames, and the screws of the joints, (6,) each."""
    still = ca.MX(3, 1)
    base = (ca.MX(ca.DM.eye(3)), still, still, still, ca.MX(ca.DM(-mechanism.gravity)))
    states: list[_FrameState] = []
    screws = []
    for i, body in enumerate(mechanism.bodies):
        before = base if body.parent == BASE else states[body.parent]
        *state, screw = _make_joint_step(body)(*before, q[i], dq[i], ddq[i])
        states.append(tuple(state))
        screws.append(screw)
    return states, screws


def _make_frame_symbols() -> list[ca.SX]:
    """Return symbols of a frame: rotation, position, angular velocity and acceleration, acceleration."""
    vectors = (ca.SX.sym(name, 3) for name in ("p", "omega", "omega_dot", "a"))
    return [ca.SX.sym("R", 3, 3), *vectors]


def _make_joint_step(body: Body) -> ca.Function:
    """Return the function from the state of the parent's frame to that of a body's frame, and the joint's screw."""
    R, p, omega, omega_dot, a = before = _make_frame_symbols()
    q, dq, ddq = (ca.SX.sym(name) for name in ("q", "dq", "ddq"))
    at_joint, to_body = body.parent_to_joint, body.joint_to_body
    place = R @ at_joint[:3, 3]
    R = R @ at_joint[:3, :3]
    z = R[:, 2]
    a = a + _express_swing(omega, omega_dot, place)
    p = p + place
    if body.joint == "revolute":
        screw = ca.vertcat(ca.cross(p, z), z)
        omega_dot = omega_dot + z * ddq + ca.cross(omega, z * dq)
        omega = omega + z * dq
        c, s = express_cosine_and_sine(q, body.offset)
        R = ca.horzcat(R[:, 0] * c + R[:, 1] * s, R[:, 1] * c - R[:, 0] * s, z)
    else:
        screw = ca.vertcat(z, ca.SX(3, 1))
        slide = z * (q + body.offset)
        a = a + _express_swing(omega, omega_dot, slide) + z * ddq + 2 * dq * ca.cross(omega, z)
        p = p + slide
    arm = R @ to_body[:3, 3]
    state = [
        R @ to_body[:3, :3],
        p + arm,
        omega,
        omega_dot,
        a + _express_swing(omega, omega_dot, arm),
    ]
    outputs = [ca.densify(value) for value in (*state, screw)]
    return ca.Function("joint", [*before, q, dq, ddq], ca.cse(outputs))


def _express_swing(omega: ca.SX, omega_dot: ca.SX, r: ca.SX) -> ca.SX:
    """Return what rotation adds to the acceleration of a point at r."""
    return ca.cross(omega_dot, r) + ca.cross(omega, ca.cross(omega, r))


def _make_unit_wrenches() -> ca.Function:
    """Return the function that gives force, and moment about the base's origin, for unit values of each parameter, (6,
    10).
    """
    R, p, omega, omega_dot, a = state = _make_frame_symbols()
    turning = ca.skew(omega_dot) + ca.skew(omega) @ ca.skew(omega)
    forces = ca.horzcat(a, turning @ R, ca.SX(3, 6))
    in_body, in_body_dot = R.T @ omega, R.T @ omega_dot
    spins = _express_tensor_product(in_body_dot) + ca.skew(in_body) @ _express_tensor_product(
        in_body
    )
    moments = ca.horzcat(ca.SX(3, 1), -ca.skew(a) @ R, R @ spins)
    wrenches = ca.vertcat(forces, moments + ca.skew(p) @ forces)
    return ca.Function("wrenches", state, ca.cse([ca.densify(wrenches)]))


def _express_tensor_product(v: ca.SX) -> ca.SX:
    """Return I v as a linear map of Ixx, Ixy, Ixz, Iyy, Iyz, Izz, (3, 6)."""
    x, y, z = v[0], v[1], v[2]
    rows = ([x, y, z, 0, 0, 0], [0, x, 0, y, z, 0], [0, 0, x, 0, y, z])
    return ca.vertcat(*(ca.horzcat(*row) for row in rows))
