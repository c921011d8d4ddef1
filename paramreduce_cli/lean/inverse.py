"""Inverse dynamics of a tree, as the choices at its joints say.

It is the Newton-Euler recursion [Luh1980] with U, in which any part of a body's inertia can
also be handed to the body before: with C_k what the turning of joint k adds to U, and J_k all
inertia beyond it, the wrenches of the bodies from j on are

    sum_m w(U_m; J_m) = w(U_j; J_j) + sum_{k > j} w(C_k; J_k).

At the joints that hand it on, only the moment about z of w(U; J) is needed.
"""

from dataclasses import replace

from paramreduce_cli.expressions.vectors import dot
from paramreduce_cli.lean.algebra import Scalar, cache_expressions
from paramreduce_cli.lean.inertia_expressions import Inertia
from paramreduce_cli.lean.joint_formulations import InertiaPlace, JointFormulation
from paramreduce_cli.lean.joint_states import JointState, Kinematics
from paramreduce_cli.lean.wrench import (
    Gauge,
    Wrench,
    compute_force_along_z,
    compute_inertial_wrench,
    compute_moment_about_z,
    compute_rotation_wrench,
    compute_translation_wrench,
    split_off,
)
from paramreduce_cli.records import BASE


def build_torques(kinematics: Kinematics) -> list[Scalar]:
    """Return the torques and forces of the joints, in the signs of the coordinates as described."""
    n = len(kinematics.states)
    nothing = kinematics.symbols.make_zero_inertia()
    zero = kinematics.symbols.make_vector((0, 0, 0))
    own = [kinematics.sum_body_inertia(i) for i in range(n)]
    at_rest = [nothing] * n
    wrench_own, wrench_rest = [Wrench(zero, zero)] * n, [Wrench(zero, zero)] * n
    result = [zero[0]] * n
    for i in reversed(range(n)):
        state, choice = kinematics.states[i], kinematics.choices[i]
        axial, rest = split_axial_part(own[i], choice, state)
        wrench = wrench_own[i]
        if kept := select_part(rest, choice, InertiaPlace.OWN):
            wrench = wrench + compute_inertial_wrench(
                kept,
                state.body_motion,
                state.body_acceleration,
                select_gauge(state, choice, InertiaPlace.OWN),
            )
        wrench = rotate_to_rest(wrench, state) + wrench_rest[i]
        if kept := select_part(rest, choice, InertiaPlace.REST):
            wrench = wrench + compute_inertial_wrench(
                state.rotation.rotate_inertia(kept),
                kinematics.express_at_rest(i),
                state.rest_acceleration,
                select_gauge(state, choice, InertiaPlace.REST),
            )
        handed = select_part(rest, choice, InertiaPlace.BEFORE)
        if handed:
            handed = state.rotation.rotate_inertia(handed)
            wrench = wrench + compute_rotation_wrench(handed, state.joint_turning)
        handed = handed + at_rest[i]
        if state.joint.revolute:
            along = wrench.moment[2] + compute_moment_about_z(
                handed, state.rest_motion, state.rest_acceleration
            )
        else:
            along = wrench.force[2] + compute_force_along_z(
                handed, state.rest_motion, state.rest_acceleration
            )
        result[i] = result[i] + state.joint.sign * along
        parent = state.joint.parent
        if parent == BASE:
            continue
        if handed:
            wrench = wrench + compute_translation_wrench(handed, state.relative_acceleration)
        if choice.projected:
            for j, along in project_on_ancestors(kinematics, i, wrench).items():
                result[j] = result[j] + kinematics.states[j].joint.sign * along
        elif state.aligned:
            wrench_rest[parent] = wrench_rest[parent] + wrench.move_point(state.reach)
        else:
            wrench_own[parent] = wrench_own[parent] + transfer_to_parent(wrench, state)
        transfer_inertia(kinematics, i, axial, handed, own, at_rest)
    return result


def split_axial_part(
    body: Inertia, choice: JointFormulation, state: JointState
) -> tuple[Inertia, Inertia]:
    """Split an inertia into the part that has the same effect in the parent body, because the joint is a hinge, and the
    rest.
    """
    nothing = _make_zero_inertia(body)
    if not state.joint.revolute:
        return nothing, body
    s, rest = split_off(body, choice.gauge)
    m = body.m if choice.mass is InertiaPlace.BEFORE else nothing.m
    z = body.d[2] if choice.axial is InertiaPlace.BEFORE else nothing.m
    axial = replace(nothing, m=m, d=(nothing.m, nothing.m, z), xx=s, yy=s)
    return axial, replace(rest, m=rest.m - m, d=(rest.d[0], rest.d[1], rest.d[2] - z))


def _make_zero_inertia(body: Inertia) -> Inertia:
    """Return an inertia of zeros in the graph of another inertia."""
    zero = body.m - body.m
    return Inertia(zero, (zero, zero, zero), *[zero] * 6)


@cache_expressions
def select_part(body: Inertia, choice: JointFormulation, place: InertiaPlace) -> Inertia:
    """Return the part of an inertia that a formulation multiplies with the motion at one recursion step; the rest is
    zero.
    """
    zero = body.m - body.m

    def keep(where: InertiaPlace, value: Scalar) -> Scalar:
        return value if where is place else zero

    radial, tilt, plane = choice.radial, choice.tilt, choice.plane
    return Inertia(
        keep(choice.mass, body.m),
        (keep(radial, body.d[0]), keep(radial, body.d[1]), keep(choice.axial, body.d[2])),
        xx=keep(plane, body.xx),
        xy=keep(plane, body.xy),
        xz=keep(tilt, body.xz),
        yy=keep(plane, body.yy),
        yz=keep(tilt, body.yz),
        zz=keep(choice.polar, body.zz),
    )


def select_gauge(state: JointState, choice: JointFormulation, place: InertiaPlace) -> Gauge:
    """Return the gauge that the inertia used at a recursion step has: which part s (1 - z z') has been moved to the
    parent body. Return NONE if the moments of inertia are not all used at this step, or if the rotation to it has mixed
    them again.

    Args:
        place: Recursion step at which the moments are to be computed; steps other than the chosen one have no gauge.
        state: State of the joint.
        choice: Formulation chosen at the joint.
    """
    if not (state.joint.revolute and choice.polar is choice.plane is place):
        return Gauge.NONE
    if place is InertiaPlace.OWN or choice.gauge is Gauge.FLAT:
        return choice.gauge
    return Gauge.NONE


def rotate_to_rest(wrench: Wrench, state: JointState) -> Wrench:
    """Return a wrench of the body's frame in the frame at rest."""
    return Wrench(state.rotation.to_parent(wrench.force), state.rotation.to_parent(wrench.moment))


def transfer_to_parent(wrench: Wrench, state: JointState) -> Wrench:
    """Return a wrench in the parent body's frame, about that frame's origin; for joints that are not aligned.

    Args:
        wrench: Wrench in the joint's frame at rest, against which the joint's angle is measured, about the joint's
            origin.
        state: State of the joint.
    """
    turned = Wrench(
        state.rest_to_parent.to_parent(wrench.force), state.rest_to_parent.to_parent(wrench.moment)
    )
    return turned.move_point(state.reach)


def project_on_ancestors(kinematics: Kinematics, i: int, wrench: Wrench) -> dict[int, Scalar]:
    """Return the torques that a wrench about the origin of joint i, at rest, needs at all joints before."""
    return {
        j: dot(w, wrench.moment) + dot(v, wrench.force)
        for j, (w, v) in kinematics.find_screws(i).items()
    }


def transfer_inertia(
    kinematics: Kinematics,
    i: int,
    axial: Inertia,
    handed: Inertia,
    inertias: list[Inertia],
    at_rest: list[Inertia],
) -> None:
    """Add a joint's inertia to the inertia of the parent body.

    Args:
        kinematics: Kinematics of the tree.
        i: Index of the joint.
        axial: Part that has the same effect in the parent body.
        handed: Inertia in the frame at rest.
        inertias: Inertias of all bodies, in their frames; changed in place.
        at_rest: Inertias of all bodies, in their frames at rest; changed in place.
    """
    state = kinematics.states[i]
    parent = state.joint.parent
    if state.aligned:
        place = kinematics.symbols.make_vector(state.joint.place)
        inertias[parent] = inertias[parent] + axial.move_point(place)
        at_rest[parent] = at_rest[parent] + handed.move_point(state.reach)
    else:
        both = state.rest_to_parent.rotate_inertia(handed + axial)
        inertias[parent] = inertias[parent] + both.move_point(state.reach)
