"""Motions that drives and force elements act along: weighted sums of coordinates, or motions between two bodies."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import casadi as ca

from paramreduce_cli.expressions.vectors import Vector, add, cross, dot, scale, subtract
from paramreduce_cli.multibody.kinematics import (
    JointMotion,
    make_joint_motions,
    transform_direction,
    transform_point,
)
from paramreduce_cli.records import BASE, Drive, FloatArray, Mechanism, MotionBetween


class DriveMotion(NamedTuple):
    """The state of a motion, in scalars of CasADi or of an expression graph."""

    weights: Sequence[Any]
    """Derivatives of the speed by the speeds of the coordinates, (n_q,): what a unit force is on each coordinate."""
    position: Any
    """Position, rad or m; zero for slips, which have none."""
    speed: Any
    acceleration: Any
    """Acceleration; zero for motions between frames, along which no rotor accelerates."""
    creepage: Any
    """Creepage of a wheel or of a linear contact; zero for others."""


def sum_weighted(weights: Sequence[float], values: Sequence[Any]) -> Any:
    """Return the sum of coordinates, or of their derivatives, with weights."""
    return sum(weight * values[i] for i, weight in enumerate(weights) if weight)


def express_weighted_sum(drive: Drive, states: Sequence[Sequence[Any]]) -> DriveMotion:
    """Return the motion of a drive whose speed is a weighted sum of the coordinates' speeds.

    Args:
        drive: The drive.
        states: Generalised coordinates q, velocities dq and accelerations ddq, (n_q,) each.
    """
    weights = drive.weights.tolist()
    creepage: Any = 0.0
    if drive.creepage is not None:
        creepage = sum(
            sum_weighted(row, state)
            for row, state in zip(drive.creepage.tolist(), states[:2], strict=True)
            if any(row)
        )
    position, speed, acceleration = (sum_weighted(weights, state) for state in states)
    return DriveMotion(weights, position, speed, acceleration, creepage)


def make_motion_function(mechanism: Mechanism, between: MotionBetween) -> ca.Function:
    """Return the function of q and dq that gives weights, position, speed and creepage of a motion between frames.

    Its value is one column, (n_q + 3,).
    """
    q, dq = (ca.SX.sym(name, mechanism.n_q) for name in ("q", "dq"))
    frames = _FramePair(mechanism, between, q)
    position: ca.SX = ca.SX(0)
    creepage: ca.SX = ca.SX(0)
    if between.kind in ("slip", "sideslip"):
        along, across = frames.express_wheel_velocities(dq)
        spin = between.radius * dq[between.spin] if between.spin >= 0 else 0
        speed = along - spin if between.kind == "slip" else across
        creepage = speed / ca.sqrt(along**2 + between.low_speed**2)
        weights = ca.gradient(speed, dq)
    else:
        position = _POSITIONS[between.kind](frames)
        weights = ca.gradient(position, q)
        speed = ca.dot(weights, dq)
    outputs = ca.densify(ca.vertcat(weights, position, speed, creepage))
    return ca.Function("motion", [q, dq], [ca.cse(outputs)])


def compute_lengths(mechanism: Mechanism, q: FloatArray) -> dict[str, FloatArray]:
    """Return the lengths of the force elements between two points, (n_states,), by name, m.

    Args:
        mechanism: Mechanism with the elements.
        q: Generalised coordinates, (n_states, n_q).
    """
    symbol = ca.SX.sym("q", mechanism.n_q)
    found = {}
    for drive in mechanism.drives:
        if drive.between is not None and drive.between.kind == "distance":
            length = _FramePair(mechanism, drive.between, symbol).express_distance()
            found[drive.name] = ca.Function("length", [symbol], [length]).map(len(q))(q.T).full()[0]
    return found


def split_motion(values: Sequence[Any]) -> DriveMotion:
    """Return the motion whose weights, position, speed and creepage are given one after the other, (n_q + 3,)."""
    *weights, position, speed, creepage = values
    return DriveMotion(weights, position, speed, 0.0, creepage)


class _FramePair:
    """The frames A and B of a motion between two bodies."""

    def __init__(self, mechanism: Mechanism, between: MotionBetween, q: ca.SX) -> None:
        self._joints: list[JointMotion] = make_joint_motions(mechanism, q)
        self._between, self._q = between, q

    def _express_point(self, which: int) -> Vector:
        """Return the origin of A or B in the base frame, m."""
        frame = self._between.frames[which]
        return transform_point(self._joints, self._between.bodies[which], frame[:3, 3])

    def _express_axis(self, which: int, k: int) -> Vector:
        """Return axis k of A or B in the base frame."""
        frame = self._between.frames[which]
        return transform_direction(self._joints, self._between.bodies[which], frame[:3, k])

    def express_distance(self) -> ca.SX:
        """Return the distance between the origins, m."""
        gap = subtract(self._express_point(1), self._express_point(0))
        along = [x for x in gap if not x.is_zero()]
        if len(along) == 1:  # programs have no absolute value
            return along[0] * ca.sign(along[0])
        return ca.sqrt(dot(gap, gap))

    def express_shift(self) -> ca.SX:
        """Return the component along an axis of A of the vector from A to B, m."""
        gap = subtract(self._express_point(1), self._express_point(0))
        return dot(self._express_axis(0, self._between.axis), gap)

    def express_turn(self) -> ca.SX:
        """Return the component along an axis of A of the small rotation of B against A, the sine of its angle."""
        j, k = (self._between.axis + 1) % 3, (self._between.axis + 2) % 3
        first = dot(self._express_axis(0, k), self._express_axis(1, j))
        return (first - dot(self._express_axis(0, j), self._express_axis(1, k))) / 2

    def express_wheel_velocities(self, dq: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return the velocity of a wheel's contact point, without spin, along and across its rolling direction, m/s."""
        normal, axle = self._express_axis(0, 2), self._express_axis(1, 1)
        forward = cross(axle, normal)
        forward = scale(1 / ca.sqrt(dot(forward, forward)), forward)
        sideways = cross(normal, forward)
        contact = scale(-self._between.radius, normal)
        velocity = add(
            self._differentiate(self._express_point(1), dq), cross(self._express_spin(dq), contact)
        )
        return dot(velocity, forward), dot(velocity, sideways)

    def _differentiate(self, vector: Vector, dq: ca.SX) -> Vector:
        """Return the derivative of a vector by time."""
        rate = ca.jtimes(ca.vertcat(*vector), self._q, dq)
        return (rate[0], rate[1], rate[2])

    def _express_spin(self, dq: ca.SX) -> Vector:
        """Return the angular velocity of the body of B in the base frame, rad/s."""
        omega: Vector = (ca.SX(0), ca.SX(0), ca.SX(0))
        body = self._between.bodies[1]
        while body != BASE:
            joint = self._joints[body].body
            if joint.joint == "revolute":
                axis = transform_direction(self._joints, body, joint.joint_to_body[2, :3])
                omega = add(omega, scale(dq[body], axis))
            body = joint.parent
        return omega


_POSITIONS = {
    "distance": _FramePair.express_distance,
    "shift": _FramePair.express_shift,
    "turn": _FramePair.express_turn,
}
"""Positions of the motions that have one."""
