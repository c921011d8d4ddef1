"""Inverse and direct dynamics as textbooks write them, for counting what they take.

The recursion of Newton and Euler over full rotation matrices, and the mass matrix column by
column from it, with common subexpressions found afterwards and nothing else done.
"""

import casadi as ca
import numpy as np

from paramreduce_cli.records import BASE, INERTIAL


def _cleaned(matrix):
    """Without the rounding of quarter turns, which would be counted as products."""
    nearest = np.round(matrix)
    return np.where(np.abs(matrix - nearest) < 1e-12, nearest, matrix)


def _inertia(phi, columns):
    m, mx, my, mz, xx, xy, xz, yy, yz, zz = (phi[columns[kind]] for kind in INERTIAL)
    tensor = ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))
    return m, ca.vertcat(mx, my, mz), tensor


def torques(mechanism, q, dq, ddq, phi, gravity):
    """Joint torques of a tree; all arguments are expressions or numbers."""
    n = mechanism.n_q
    rotations, origins, axes, omega, rate, acceleration = [], [], [], [], [], []
    for i, body in enumerate(mechanism.bodies):
        before, after = _cleaned(body.parent_to_joint), _cleaned(body.joint_to_body)
        value = q[i] + body.offset if body.offset else q[i]
        revolute = body.joint == "revolute"
        c, s = (ca.cos(value), ca.sin(value)) if revolute else (ca.SX(1), ca.SX(0))
        Rz = ca.vertcat(ca.horzcat(c, -s, 0), ca.horzcat(s, c, 0), ca.horzcat(0, 0, 1))
        slide = ca.vertcat(0, 0, 0 if revolute else value)
        R = before[:3, :3] @ Rz @ after[:3, :3]
        r = before[:3, 3] + before[:3, :3] @ (Rz @ after[:3, 3] + slide)
        z = ca.SX(after[2, :3])
        root = body.parent == BASE
        w, dw = (ca.SX(3, 1),) * 2 if root else (omega[body.parent], rate[body.parent])
        a = ca.SX(-gravity) if root else acceleration[body.parent]
        own_w, own_dw = R.T @ w, R.T @ dw
        own_a = R.T @ (a + ca.cross(dw, r) + ca.cross(w, ca.cross(w, r)))
        if revolute:
            arm = ca.SX(after[:3, :3].T @ after[:3, 3])
            spin = dq[i] * z
            extra = ddq[i] * z + ca.cross(own_w, spin)
            # The origin turns about the axis with the joint: what r does not say yet.
            own_a = own_a + ca.cross(extra, arm) + ca.cross(spin, ca.cross(spin, arm))
            own_a = own_a + ca.cross(own_w, ca.cross(spin, arm))
            own_a = own_a + ca.cross(spin, ca.cross(own_w, arm))
            own_w, own_dw = own_w + spin, own_dw + extra
        else:
            own_a = own_a + ddq[i] * z + 2 * ca.cross(own_w, dq[i] * z)
        rotations.append(R), origins.append(r), axes.append((z, after))
        omega.append(own_w), rate.append(own_dw), acceleration.append(own_a)
    forces, moments = [], []
    for i in range(n):
        own = mechanism.list_rigid_parts(i)
        if not own:
            forces.append(ca.SX(3, 1)), moments.append(ca.SX(3, 1))
            continue
        m, d, tensor = _inertia(phi, own[0].columns)
        w, dw, a = omega[i], rate[i], acceleration[i]
        forces.append(m * a + ca.cross(dw, d) + ca.cross(w, ca.cross(w, d)))
        moments.append(tensor @ dw + ca.cross(w, tensor @ w) + ca.cross(d, a))
    tau = [ca.SX(0)] * n
    for i in reversed(range(n)):
        z, after = axes[i]
        if mechanism.bodies[i].joint == "revolute":
            arm = ca.SX(after[:3, :3].T @ after[:3, 3])
            tau[i] = ca.dot(z, moments[i] + ca.cross(arm, forces[i]))
        else:
            tau[i] = ca.dot(z, forces[i])
        parent = mechanism.bodies[i].parent
        if parent != BASE:
            force = rotations[i] @ forces[i]
            forces[parent] = forces[parent] + force
            moments[parent] = (
                moments[parent] + rotations[i] @ moments[i] + ca.cross(origins[i], force)
            )
    return ca.vertcat(*tau)


def count(mechanism, kept):
    """Operations of IDM and [M | delta] with some parameters, the others zero."""
    n = mechanism.n_q
    q, dq, ddq = (ca.SX.sym(s, n) for s in ("q", "dq", "ddq"))
    phi = ca.SX.sym("phi", mechanism.n_parameters)
    tau = torques(mechanism, q, dq, ddq, phi, mechanism.gravity)
    still = np.zeros(n)
    columns = [torques(mechanism, q, still, np.eye(n)[k], phi, np.zeros(3)) for k in range(n)]
    lower = [columns[j][i] for i in range(n) for j in range(i + 1)]
    delta = torques(mechanism, q, dq, still, phi, mechanism.gravity)
    dropped = np.setdiff1d(np.arange(phi.numel()), kept).tolist()
    values = [ca.SX(0) if k in dropped else phi[k] for k in range(phi.numel())]
    outputs = ca.substitute([tau, ca.vertcat(*lower, delta)], [phi], [ca.vertcat(*values)])
    inputs = [q, dq, ddq, phi]
    return tuple(_operations(ca.Function("f", inputs, ca.cse([output]))) for output in outputs)


_FREE = {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST, ca.OP_NEG}


def _operations(function):
    """Instructions of CasADi's virtual machine that calculate; changes of sign are free."""
    found = (function.instruction_id(k) for k in range(function.n_instructions()))
    return sum(operation not in _FREE for operation in found)
