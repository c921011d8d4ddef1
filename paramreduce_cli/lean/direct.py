"""The mass matrix of a tree by composite bodies [Walker1982], as the choices at its joints say."""

from paramreduce_cli.lean.algebra import Scalar
from paramreduce_cli.lean.inertia import Inertia
from paramreduce_cli.lean.inverse import (
    axial_part,
    hand_on,
    on_body_before,
    projections,
    turned_out,
)
from paramreduce_cli.lean.kinematics import JointState, Kinematics
from paramreduce_cli.lean.wrench import Wrench
from paramreduce_cli.records import BASE


def mass_matrix(kinematics: Kinematics) -> list[list[Scalar]]:
    """The lower triangle, row by row, in the signs of the coordinates as described."""
    states = kinematics.states
    n = len(states)
    zero = kinematics.symbols.number(0.0)
    own = [kinematics.body(i) for i in range(n)]
    at_rest = [kinematics.symbols.no_inertia()] * n
    M = [[zero] * (i + 1) for i in range(n)]
    for i in reversed(range(n)):
        state = states[i]
        axial, rest = axial_part(own[i], kinematics.choices[i], state)
        composite = state.turn.inertia(rest) + at_rest[i]
        wrench = _unit_acceleration(state, composite, zero)
        M[i][i] = _along(state, wrench)
        at = i
        while (parent := states[at].joint.parent) != BASE:
            if kinematics.choices[at].projected:
                for j, along in projections(kinematics, at, wrench).items():
                    M[i][j] = state.joint.sign * states[j].joint.sign * along
                break
            if states[at].aligned:
                wrench = wrench.moved(states[at].reach)
            else:
                wrench = on_body_before(wrench, states[at])
            sign = state.joint.sign * states[parent].joint.sign
            M[i][parent] = sign * _along(states[parent], wrench)
            if not states[at].aligned:
                wrench = turned_out(wrench, states[parent])
            at = parent
        if state.joint.parent != BASE:
            hand_on(kinematics, i, axial, composite, own, at_rest)
    return M


def _unit_acceleration(state: JointState, body: Inertia, zero: Scalar) -> Wrench:
    """What all inertia beyond a joint needs for a unit acceleration of it from rest."""
    x, y, _ = body.d
    if state.joint.revolute:
        return Wrench((-y, x, zero), (body.xz, body.yz, body.zz))
    return Wrench((zero, zero, body.m), (y, -x, zero))


def _along(state: JointState, wrench: Wrench) -> Scalar:
    return wrench.moment[2] if state.joint.revolute else wrench.force[2]
