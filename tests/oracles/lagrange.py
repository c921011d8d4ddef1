"""Lagrange's equations from energies, by automatic differentiation of homogeneous transforms.

Loops are closed with Lagrange multipliers; nothing here knows of projections.
"""

import casadi as ca
import numpy as np

from paramreduce_cli.records import INERTIAL, Kind


class Lagrange:
    """Energies, equations of motion and closure equations of a mechanism as CasADi functions."""

    def __init__(self, mechanism):
        n = mechanism.n_q
        q, dq, ddq = (ca.MX.sym(name, n) for name in ("q", "dq", "ddq"))
        phi = ca.MX.sym("phi", mechanism.n_parameters)
        poses = _poses(mechanism, q)
        kinetic, potential = 0, 0
        for rigid in mechanism.rigid:
            own = ca.vertcat(*(phi[rigid.columns[kind]] for kind in INERTIAL))
            pose = poses[rigid.body] @ ca.DM(rigid.frame)
            own_kinetic, own_potential = _energies(pose, q, dq, own, mechanism.gravity)
            kinetic, potential = kinetic + own_kinetic, potential + own_potential
        potential_of_bodies = potential
        lost = 0
        for drive in mechanism.drives:
            value = {kind: phi[c] for kind, c in mechanism.find_drive_columns(drive).items()}
            position, speed = ca.dot(drive.weights, q), ca.dot(drive.weights, dq)
            kinetic += value.get(Kind.ROTOR, 0) * speed**2 / 2
            potential += value.get(Kind.STIFFNESS, 0) * (position - drive.rest) ** 2 / 2
            potential += value.get(Kind.OFFSET, 0) * position
            friction = value.get(Kind.VISCOUS, 0) * speed
            slope = ca.tanh(speed / drive.smoothing) if drive.smoothing else ca.sign(speed)
            friction += value.get(Kind.COULOMB, 0) * slope
            fading = slope - ca.tanh(speed / drive.stribeck_velocity)
            friction += value.get(Kind.STRIBECK, 0) * fading
            friction += value.get(Kind.ASYMMETRY, 0) * ca.fabs(speed)
            friction += value.get(Kind.QUADRATIC, 0) * speed * ca.fabs(speed)
            if Kind.LOAD in value:
                gravity = ca.substitute(ca.gradient(potential_of_bodies, q), phi, mechanism.nominal)
                load = ca.dot(drive.weights, gravity) / ca.sumsqr(ca.DM(drive.weights))
                friction += value[Kind.LOAD] * ca.fabs(load) * slope
            lost += friction * ca.gradient(speed, dq)
        momentum = ca.gradient(kinetic, dq)
        rate = ca.jtimes(momentum, q, dq) + ca.jtimes(momentum, dq, ddq)
        tau = rate - ca.gradient(kinetic - potential, q) + lost
        gaps = _gaps(mechanism, poses, q)
        jacobian = ca.jacobian(gaps, q)
        drift = ca.jtimes(ca.jtimes(gaps, q, dq), q, dq)
        self.tau = ca.Function("tau", [q, dq, ddq, phi], [tau])
        self.tau_by_phi = ca.Function("K", [q, dq, ddq, phi], [ca.jacobian(tau, phi)])
        self.mass_matrix = ca.Function("M", [q, phi], [ca.hessian(kinetic, dq)[0]])
        self.energy = ca.Function("E", [q, dq, phi], [kinetic + potential])
        self.closures = ca.Function("closures", [q, dq], [gaps, jacobian, drift])


def _poses(mechanism, q):
    poses = []
    for k, body in enumerate(mechanism.bodies):
        value = q[k] + body.offset
        turn = (ca.cos(value), ca.sin(value), 0)
        c, s, slide = turn if body.joint == "revolute" else (1, 0, value)
        motion = ca.vertcat(
            ca.horzcat(c, -s, 0, 0), ca.horzcat(s, c, 0, 0), ca.horzcat(0, 0, 1, slide),
            ca.horzcat(0, 0, 0, 1),
        )  # fmt: skip
        local = ca.mtimes([ca.DM(body.parent_to_joint), motion, ca.DM(body.joint_to_body)])
        poses.append(local if body.parent < 0 else ca.mtimes(poses[body.parent], local))
    return poses


def _energies(pose, q, dq, phi, gravity):
    R, p = pose[:3, :3], pose[:3, 3]
    v = ca.jtimes(p, q, dq)
    R_dot = ca.reshape(ca.jtimes(ca.vec(R), q, dq), 3, 3)
    skew = R.T @ R_dot
    w = ca.vertcat(skew[2, 1], skew[0, 2], skew[1, 0])
    m, moment = phi[0], phi[1:4]
    xx, xy, xz, yy, yz, zz = (phi[i] for i in range(4, 10))
    inertia = ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))
    kinetic = m * ca.dot(v, v) / 2 + ca.dot(v, R @ ca.cross(w, moment))
    kinetic += ca.dot(w, inertia @ w) / 2
    return kinetic, -ca.dot(ca.DM(gravity), m * p + R @ moment)


def _gaps(mechanism, poses, q):
    """Closure equations, in whatever form is shortest with homogeneous transforms."""
    gaps = []
    for closure in mechanism.loops.closures if mechanism.loops else ():
        A, B = (
            ca.DM(frame) if body < 0 else poses[body] @ ca.DM(frame)
            for body, frame in zip(closure.bodies, closure.frames, strict=True)
        )
        if closure.kind == "distance":
            gaps.append(ca.norm_2(A[:3, 3] - B[:3, 3]) - closure.length)
            continue
        if closure.kind == "coupling":
            first, second = closure.bodies
            gaps.append(q[second] - closure.ratio * q[first] - closure.offset)
            continue
        seen, turn = A[:3, :3].T @ (B[:3, 3] - A[:3, 3]), A[:3, :3].T @ B[:3, :3]
        gaps.append(seen[:2] if closure.kind in ("planar", "prismatic", "cylindrical") else seen)
        if closure.kind in ("revolute", "cylindrical"):
            gaps.append(turn[:2, 2])
        elif closure.kind in ("fixed", "prismatic"):
            gaps.append(ca.inv_skew(turn - turn.T))
        elif closure.kind == "universal":
            gaps.append(turn[0, 1])
    return ca.vertcat(*gaps) if gaps else ca.MX(0, 1)


def forward_dynamics(oracle, independent, q, dq, phi, tau):
    """Accelerations and multipliers from the KKT system of one state.

    M ddq + J' l = S' tau - h and J ddq = -dJ/dt dq, with S picking the independent coordinates.
    """
    n = q.size
    M = np.array(oracle.mass_matrix(q, phi))
    h = np.array(oracle.tau(q, dq, np.zeros(n), phi)).ravel()
    _, J, drift = (np.array(part) for part in oracle.closures(q, dq))
    force = np.zeros(n)
    force[list(independent)] = tau
    kkt = np.block([[M, J.T], [J, np.zeros((J.shape[0], J.shape[0]))]])
    solution = np.linalg.solve(kkt, np.concatenate([force - h, -drift.ravel()]))
    return solution[:n]


def tangent(oracle, independent, q):
    """dq/dz from the null space of the closures' Jacobian."""
    _, J, _ = (np.array(part) for part in oracle.closures(q, np.zeros(q.size)))
    _, s, Vt = np.linalg.svd(J)
    null = Vt[int(np.sum(s > 1e-9 * s.max(initial=0.0))) :].T
    return null @ np.linalg.inv(null[list(independent)])
