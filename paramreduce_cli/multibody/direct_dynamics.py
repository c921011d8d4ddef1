"""Direct dynamics [M | delta], symbolically.

The mass matrix by composite bodies [Walker1982], whose inertias are carried as the ten
standard parameters, so that M stays linear in them; the bias by the same recursion as the
inverse dynamics, at zero acceleration.
"""

from __future__ import annotations

import casadi as ca

from paramreduce_cli.multibody.inverse_dynamics import (
    BodyInertia,
    body_inertias,
    inverse_dynamics,
)
from paramreduce_cli.multibody.kinematics import (
    JointMotion,
    Matrix,
    Vector,
    add,
    cross,
    dot,
    motions,
    scale,
)
from paramreduce_cli.records import BASE, Mechanism


def direct_dynamics(
    mechanism: Mechanism, q: ca.SX, dq: ca.SX, phi: ca.SX
) -> tuple[list[list[ca.SX]], list[ca.SX]]:
    """Mass matrix and bias forces of the open tree.

    Args:
        mechanism: The tree; its loops are left open.
        q: Generalised coordinates, (n_q,), rad or m.
        dq: Velocities.
        phi: Standard parameters, (n_parameters,).

    Returns:
        M as rows (both triangles, sharing expressions) and delta, with
        tau = M ddq + delta.
    """
    still = ca.SX(mechanism.n_q, 1)
    delta = inverse_dynamics(mechanism, q, dq, still, phi)
    return mass_matrix(mechanism, q, phi), delta


def mass_matrix(mechanism: Mechanism, q: ca.SX, phi: ca.SX) -> list[list[ca.SX]]:
    """Mass matrix of the tree by composite bodies."""
    joints = motions(mechanism, q)
    n = mechanism.n_q
    composites = body_inertias(mechanism, phi)
    for i in reversed(range(n)):
        parent = mechanism.bodies[i].parent
        if parent != BASE:
            composites[parent] = _sum(composites[parent], carry(joints[i], composites[i]))
    M = [[ca.SX(0)] * n for _ in range(n)]
    for i in range(n):
        force, moment = _unit_acceleration(joints[i], composites[i])
        M[i][i] = _along(joints[i], force, moment)
        j = i
        while (parent := mechanism.bodies[j].parent) != BASE:
            force, moment = joints[j].to_parent(force), joints[j].to_parent(moment)
            moment = add(moment, cross(joints[j].origin, force))
            j = parent
            M[i][j] = M[j][i] = _along(joints[j], force, moment)
    return M


def _unit_acceleration(joint: JointMotion, body: BodyInertia) -> tuple[Vector, Vector]:
    """Wrench about the body's origin that gives its joint a unit acceleration from rest."""
    axis = joint.axis()
    if joint.body.joint == "prismatic":
        return scale(body.m, axis), cross(body.moment, axis)
    spin = tuple(dot(axis, row) for row in body.tensor)
    lift = cross(axis, joint.arm())
    force = add(cross(axis, body.moment), scale(body.m, lift))
    return force, add((spin[0], spin[1], spin[2]), cross(body.moment, lift))


def _along(joint: JointMotion, force: Vector, moment: Vector) -> ca.SX:
    """Component of a wrench about the body's origin along the joint."""
    axis = joint.axis()
    if joint.body.joint == "prismatic":
        return dot(axis, force)
    return dot(axis, add(moment, cross(joint.arm(), force)))


def _sum(a: BodyInertia, b: BodyInertia) -> BodyInertia:
    rows = [add(x, y) for x, y in zip(a.tensor, b.tensor, strict=True)]
    return BodyInertia(a.m + b.m, add(a.moment, b.moment), (rows[0], rows[1], rows[2]))


def carry(joint: JointMotion, body: BodyInertia) -> BodyInertia:
    """A body's parameters seen from its parent's frame: turned, then shifted to its origin."""
    after, before = joint.body.after[:3, :3].tolist(), joint.body.before[:3, :3].tolist()
    tensor = _turn(after, body.tensor)
    tensor = _turn_about_z(joint.cosine, joint.sine, tensor)
    tensor = _turn(before, tensor)
    moment = joint.to_parent(body.moment)
    origin = joint.origin
    shifted = add(moment, scale(body.m, origin))
    return BodyInertia(body.m, shifted, _shift(tensor, origin, moment, shifted))


def _shift(tensor: Matrix, r: Vector, old: Vector, new: Vector) -> Matrix:
    """Parallel axes: I + (r.h) 1 - r h' - h' r with h the first moments old + new, halved.

    With h_o and h_n the first moments before and after, the added tensor is
    (r . (h_o + h_n)) 1 - (r_i h_o_j + h_n_i r_j), which is symmetric.
    """
    px, py, pz = (r[k] * (old[k] + new[k]) for k in range(3))

    def off(i: int, j: int) -> ca.SX:
        return tensor[i][j] - (r[i] * old[j] + new[i] * r[j])

    xy, xz, yz = off(0, 1), off(0, 2), off(1, 2)
    return (
        (tensor[0][0] + (py + pz), xy, xz),
        (xy, tensor[1][1] + (px + pz), yz),
        (xz, yz, tensor[2][2] + (px + py)),
    )


def _turn(rotation: list[list[float]], tensor: Matrix) -> Matrix:
    """R I R' for a constant rotation; by its quarter turns where it has them."""
    half = [[dot(rotation[j], tensor[i]) for j in range(3)] for i in range(3)]
    full = [
        [
            rotation[i][0] * half[0][j] + rotation[i][1] * half[1][j] + rotation[i][2] * half[2][j]
            for j in range(3)
        ]
        for i in range(3)
    ]
    return (
        (full[0][0], full[0][1], full[0][2]),
        (full[0][1], full[1][1], full[1][2]),
        (full[0][2], full[1][2], full[2][2]),
    )


def _turn_about_z(c: ca.SX, s: ca.SX, tensor: Matrix) -> Matrix:
    """Rz I Rz' in nine products: the xx-yy-xy block turns by the double angle."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = tensor
    cs, ss = c * s, s * s
    difference = xx - yy
    shift = ss * difference + 2 * (cs * xy)
    cross_term = cs * difference + xy - 2 * (ss * xy)
    new_xz, new_yz = c * xz - s * yz, s * xz + c * yz
    return (
        (xx - shift, cross_term, new_xz),
        (cross_term, yy + shift, new_yz),
        (new_xz, new_yz, zz),
    )
