"""The mass matrix of a tree by composite bodies [Walker1982], as the choices at its joints say."""

from paramreduce_cli.lean.algebra import Scalar
from paramreduce_cli.lean.inertia_expressions import Inertia
from paramreduce_cli.lean.inverse import (
    project_on_ancestors,
    rotate_to_rest,
    split_axial_part,
    transfer_inertia,
    transfer_to_parent,
)
from paramreduce_cli.lean.joint_states import JointState, Kinematics
from paramreduce_cli.lean.wrench import Wrench
from paramreduce_cli.records import BASE


def build_mass_matrix(kinematics: Kinematics) -> list[list[Scalar]]:
    """Return the lower triangle of M, row by row, in the signs of the coordinates as described."""
    states = kinematics.states
    n = len(states)
    zero = kinematics.symbols.make_constant(0.0)
    own = [kinematics.sum_body_inertia(i) for i in range(n)]
    at_rest = [kinematics.symbols.make_zero_inertia()] * n
    M = [[zero] * (i + 1) for i in range(n)]
    for i in reversed(range(n)):
        state = states[i]
        axial, rest = split_axial_part(own[i], kinematics.choices[i], state)
        composite = state.rotation.rotate_inertia(rest) + at_rest[i]
        wrench = _accelerate_composite(state, composite, zero)
        M[i][i] = _project_on_axis(state, wrench)
        at = i
        while (parent := states[at].joint.parent) != BASE:
            if kinematics.choices[at].projected:
                for j, along in project_on_ancestors(kinematics, at, wrench).items():
                    M[i][j] = state.joint.sign * states[j].joint.sign * along
                break
            if states[at].aligned:
                wrench = wrench.move_point(states[at].reach)
            else:
                wrench = transfer_to_parent(wrench, states[at])
            sign = state.joint.sign * states[parent].joint.sign
            M[i][parent] = sign * _project_on_axis(states[parent], wrench)
            if not states[at].aligned:
                wrench = rotate_to_rest(wrench, states[parent])
            at = parent
        if state.joint.parent != BASE:
            transfer_inertia(kinematics, i, axial, composite, own, at_rest)
    return M


def _accelerate_composite(state: JointState, body: Inertia, zero: Scalar) -> Wrench:
    """Return the wrench that all inertia beyond a joint needs for a unit acceleration of the joint from rest."""
    x, y, _ = body.d
    if state.joint.revolute:
        return Wrench((-y, x, zero), (body.xz, body.yz, body.zz))
    return Wrench((zero, zero, body.m), (y, -x, zero))


def _project_on_axis(state: JointState, wrench: Wrench) -> Scalar:
    return wrench.moment[2] if state.joint.revolute else wrench.force[2]
