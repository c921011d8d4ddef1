"""Inverse dynamics of a tree, as the choices at its joints say.

It is the Newton-Euler recursion [Luh1980] with U, in which any part of a body's inertia can
also be handed to the body before: with C_k what the turning of joint k adds to U, and J_k all
inertia beyond it, the wrenches of the bodies from j on are

    sum_m w(U_m; J_m) = w(U_j; J_j) + sum_{k > j} w(C_k; J_k).

At the joints that hand it on, only the moment about z of w(U; J) is needed.
"""

from dataclasses import replace

from paramreduce_cli.expressions.vectors import dot
from paramreduce_cli.lean.algebra import Scalar, remembered
from paramreduce_cli.lean.choices import JointFormulation, Place
from paramreduce_cli.lean.inertia import Inertia
from paramreduce_cli.lean.kinematics import JointState, Kinematics
from paramreduce_cli.lean.wrench import (
    Gauge,
    Wrench,
    force_along_z,
    inertial_wrench,
    pushed,
    spin_about_z,
    split_off,
    turning_wrench,
)
from paramreduce_cli.records import BASE


def torques(kinematics: Kinematics) -> list[Scalar]:
    """Torques and forces of the joints, in the signs of the coordinates as described."""
    n = len(kinematics.states)
    nothing = kinematics.symbols.no_inertia()
    zero = kinematics.symbols.vector((0, 0, 0))
    own = [kinematics.body(i) for i in range(n)]
    at_rest = [nothing] * n
    wrench_own, wrench_rest = [Wrench(zero, zero)] * n, [Wrench(zero, zero)] * n
    result = [zero[0]] * n
    for i in reversed(range(n)):
        state, choice = kinematics.states[i], kinematics.choices[i]
        axial, rest = axial_part(own[i], choice, state)
        wrench = wrench_own[i]
        if kept := part(rest, choice, Place.OWN):
            wrench = wrench + inertial_wrench(
                kept, state.body_motion, state.body_acceleration, form(state, choice, Place.OWN)
            )
        wrench = turned_out(wrench, state) + wrench_rest[i]
        if kept := part(rest, choice, Place.REST):
            wrench = wrench + inertial_wrench(
                state.turn.inertia(kept),
                kinematics.rest_components(i),
                state.rest_acceleration,
                form(state, choice, Place.REST),
            )
        handed = part(rest, choice, Place.BEFORE)
        if handed:
            handed = state.turn.inertia(handed)
            wrench = wrench + turning_wrench(handed, state.joint_turning)
        handed = handed + at_rest[i]
        if state.joint.revolute:
            along = wrench.moment[2] + spin_about_z(
                handed, state.rest_motion, state.rest_acceleration
            )
        else:
            along = wrench.force[2] + force_along_z(
                handed, state.rest_motion, state.rest_acceleration
            )
        result[i] = result[i] + state.joint.sign * along
        parent = state.joint.parent
        if parent == BASE:
            continue
        if handed:
            wrench = wrench + pushed(handed, state.relative_acceleration)
        if choice.projected:
            for j, along in projections(kinematics, i, wrench).items():
                result[j] = result[j] + kinematics.states[j].joint.sign * along
        elif state.aligned:
            wrench_rest[parent] = wrench_rest[parent] + wrench.moved(state.reach)
        else:
            wrench_own[parent] = wrench_own[parent] + on_body_before(wrench, state)
        hand_on(kinematics, i, axial, handed, own, at_rest)
    return result


def axial_part(
    body: Inertia, choice: JointFormulation, state: JointState
) -> tuple[Inertia, Inertia]:
    """What a hinge cannot tell from a part of the body before, as far as it is chosen, and the rest."""
    nothing = _no_inertia(body)
    if not state.joint.revolute:
        return nothing, body
    s, rest = split_off(body, choice.gauge)
    m = body.m if choice.mass is Place.BEFORE else nothing.m
    z = body.d[2] if choice.axial is Place.BEFORE else nothing.m
    axial = replace(nothing, m=m, d=(nothing.m, nothing.m, z), xx=s, yy=s)
    return axial, replace(rest, m=rest.m - m, d=(rest.d[0], rest.d[1], rest.d[2] - z))


def _no_inertia(body: Inertia) -> Inertia:
    zero = body.m - body.m
    return Inertia(zero, (zero, zero, zero), *[zero] * 6)


@remembered
def part(body: Inertia, choice: JointFormulation, place: Place) -> Inertia:
    """The part of an inertia that is met at a place."""
    zero = body.m - body.m

    def kept(where: Place, value: Scalar) -> Scalar:
        return value if where is place else zero

    radial, tilt, plane = choice.radial, choice.tilt, choice.plane
    return Inertia(
        kept(choice.mass, body.m),
        (kept(radial, body.d[0]), kept(radial, body.d[1]), kept(choice.axial, body.d[2])),
        xx=kept(plane, body.xx),
        xy=kept(plane, body.xy),
        xz=kept(tilt, body.xz),
        yy=kept(plane, body.yy),
        yz=kept(tilt, body.yz),
        zz=kept(choice.polar, body.zz),
    )


def form(state: JointState, choice: JointFormulation, place: Place) -> Gauge:
    """What is known of the moments of inertia at a place."""
    if not (state.joint.revolute and choice.polar is choice.plane is place):
        return Gauge.NONE
    if place is Place.OWN or choice.gauge is Gauge.FLAT:
        return choice.gauge
    return Gauge.NONE


def turned_out(wrench: Wrench, state: JointState) -> Wrench:
    """From the body's frame to that at rest."""
    return Wrench(state.turn.out(wrench.force), state.turn.out(wrench.moment))


def on_body_before(wrench: Wrench, state: JointState) -> Wrench:
    """From the frame at rest to that of the body before, about its origin; not where aligned."""
    turned = Wrench(state.rest_to_parent.out(wrench.force), state.rest_to_parent.out(wrench.moment))
    return turned.moved(state.reach)


def projections(kinematics: Kinematics, i: int, wrench: Wrench) -> dict[int, Scalar]:
    """What a wrench about the origin of joint i, at rest, needs of all joints before."""
    return {
        j: dot(w, wrench.moment) + dot(v, wrench.force)
        for j, (w, v) in kinematics.screws(i).items()
    }


def hand_on(
    kinematics: Kinematics,
    i: int,
    axial: Inertia,
    handed: Inertia,
    own: list[Inertia],
    at_rest: list[Inertia],
) -> None:
    """Add inertia to that of the body before.

    Args:
        kinematics: Of the tree.
        i: The joint.
        axial: Part that may as well be of the body before.
        handed: In the frame at rest.
        own: Of all bodies, in their frames; changed.
        at_rest: Of all bodies, in their frames at rest; changed.
    """
    state = kinematics.states[i]
    parent = state.joint.parent
    if state.aligned:
        place = kinematics.symbols.vector(state.joint.place)
        own[parent] = own[parent] + axial.shifted(place)
        at_rest[parent] = at_rest[parent] + handed.shifted(state.reach)
    else:
        both = state.rest_to_parent.inertia(handed + axial)
        own[parent] = own[parent] + both.shifted(state.reach)
