"""Inverse and direct dynamics as textbooks write them, for counting what they take.

The recursion of Newton and Euler over full rotation matrices, and the mass matrix column by
column from it, with common subexpressions found afterwards and nothing else done.
"""

import casadi as ca
import numpy as np

from paramreduce_cli.expressions.operations import Program
from paramreduce_cli.records import BASE, PARAMETER_KINDS

WIDTH = len(PARAMETER_KINDS)


def _cleaned(matrix):
    """Without the rounding of quarter turns, which would be counted as products."""
    nearest = np.round(matrix)
    return np.where(np.abs(matrix - nearest) < 1e-12, nearest, matrix)


def _inertia(phi, position):
    m, mx, my, mz, xx, xy, xz, yy, yz, zz = (phi[WIDTH * position + k] for k in range(WIDTH))
    tensor = ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))
    return m, ca.vertcat(mx, my, mz), tensor


def torques(mechanism, q, dq, ddq, phi, gravity):
    """Joint torques of a tree; all arguments are expressions or numbers."""
    n = mechanism.n_q
    order = {body: k for k, body in enumerate(mechanism.inertial)}
    rotations, origins, axes, omega, rate, acceleration = [], [], [], [], [], []
    for i, body in enumerate(mechanism.bodies):
        before, after = _cleaned(body.before), _cleaned(body.after)
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
        if i not in order:
            forces.append(ca.SX(3, 1)), moments.append(ca.SX(3, 1))
            continue
        m, d, tensor = _inertia(phi, order[i])
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
    phi = ca.SX.sym("phi", len(mechanism.parameter_names))
    tau = torques(mechanism, q, dq, ddq, phi, mechanism.gravity)
    still = np.zeros(n)
    columns = [torques(mechanism, q, still, np.eye(n)[k], phi, np.zeros(3)) for k in range(n)]
    lower = [columns[j][i] for i in range(n) for j in range(i + 1)]
    delta = torques(mechanism, q, dq, still, phi, mechanism.gravity)
    dropped = sorted(set(range(phi.numel())) - {int(k) for k in kept})
    inverse = ca.Function("d", [phi, q, dq, ddq], [tau])
    direct = ca.Function("m", [phi, q, dq], [ca.vertcat(*lower, delta)])
    return tuple(Program.of_function(f).count(dropped) for f in (inverse, direct))
