"""Lagrange's equations from energies, by automatic differentiation of homogeneous transforms."""

import casadi as ca
import numpy as np


def inverse_dynamics(mechanism):
    """A function (z, dz, ddz, phi) -> tau made from kinetic and potential energy alone."""
    n = mechanism.n_dof
    z, dz, ddz = (ca.MX.sym(name, n) for name in ("z", "dz", "ddz"))
    phi = ca.MX.sym("phi", 10 * n)
    kinetic, potential = 0, 0
    poses = []
    for k, body in enumerate(mechanism.bodies):
        angle = z[k] + body.offset
        zero, one = ca.MX(0), ca.MX(1)
        if body.joint == "revolute":
            c, s, slide = ca.cos(angle), ca.sin(angle), zero
        else:
            c, s, slide = one, zero, angle
        motion = ca.vertcat(
            ca.horzcat(c, -s, 0, 0), ca.horzcat(s, c, 0, 0), ca.horzcat(0, 0, 1, slide),
            ca.horzcat(0, 0, 0, 1),
        )  # fmt: skip
        local = ca.mtimes([ca.DM(body.before), motion, ca.DM(body.after)])
        pose = local if body.parent < 0 else ca.mtimes(poses[body.parent], local)
        poses.append(pose)
        R, p = pose[:3, :3], pose[:3, 3]
        v = ca.jtimes(p, z, dz)
        R_dot = ca.reshape(ca.jtimes(ca.vec(R), z, dz), 3, 3)
        skew = R.T @ R_dot
        w = ca.vertcat(skew[2, 1], skew[0, 2], skew[1, 0])
        m, moment = phi[10 * k], phi[10 * k + 1 : 10 * k + 4]
        xx, xy, xz, yy, yz, zz = (phi[10 * k + i] for i in range(4, 10))
        inertia = ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))
        kinetic += m * ca.dot(v, v) / 2 + ca.dot(v, R @ ca.cross(w, moment))
        kinetic += ca.dot(w, inertia @ w) / 2
        potential -= ca.dot(ca.DM(mechanism.gravity), m * p + R @ moment)
    momentum = ca.gradient(kinetic, dz)
    rate = ca.jtimes(momentum, z, dz) + ca.jtimes(momentum, dz, ddz)
    tau = rate - ca.gradient(kinetic - potential, z)
    function = ca.Function("tau", [z, dz, ddz, phi], [tau])
    return lambda *values: np.array(function(*values)).ravel()
