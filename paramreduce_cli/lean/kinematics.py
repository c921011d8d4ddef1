"""The motion of every frame of a tree, as the choices at its joints say."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.expressions.vectors import Vector, add, cross
from paramreduce_cli.lean.algebra import Scalar
from paramreduce_cli.lean.choices import JointFormulation
from paramreduce_cli.lean.inertia import Inertia
from paramreduce_cli.lean.motion import (
    FrameMotion,
    Turning,
    motion,
    seen_through,
    slide,
    turned,
    turning,
)
from paramreduce_cli.lean.tree import Joint, Tree
from paramreduce_cli.lean.turns import ConstantTurn, Turn, constant_turn, turn_by
from paramreduce_cli.records import BASE, INERTIAL, FloatArray, Rigid
from paramreduce_cli.robots.frames import clean_rotation


class Symbols:
    """The inputs of all models of a tree: parameters first, then q, dq and ddq.

    Args:
        graph: Where they are.
        tree: Whose models.
        dropped: Positions of parameters that are zero.
    """

    def __init__(self, graph: Graph, tree: Tree, dropped: Collection[int] = ()) -> None:
        self.graph = graph
        self._dropped = frozenset(dropped)
        self._start = tree.n_parameters
        self._joints = tree.joints

    def number(self, value: float) -> Scalar:
        """A number that is known when the code is written."""
        return Scalar(self.graph, self.graph.constant(value))

    def vector(self, values: Sequence[float] | FloatArray) -> Vector:
        """Three constants."""
        x, y, z = (self.number(float(value)) for value in values)
        return (x, y, z)

    def coordinate(self, i: int, derivative: int) -> Scalar:
        """Of joint i as described: the coordinate, its speed or its acceleration."""
        position = self._start + derivative * len(self._joints) + i
        return Scalar(self.graph, self.graph.input(position))

    def carrying(self) -> tuple[Vector, Vector, Vector]:
        """Angular velocity and acceleration, and acceleration less gravity, of a base that moves."""
        start = self._start + 3 * len(self._joints)
        values = [Scalar(self.graph, self.graph.input(start + k)) for k in range(9)]
        x, y, z = ((a, b, c) for a, b, c in zip(*[iter(values)] * 3, strict=True))
        return x, y, z

    def inertia(self, rigid: Rigid) -> Inertia:
        """The parameters of a body or payload, in its frame as described."""
        m, x, y, z, *tensor = (self.parameter(rigid.columns[kind]) for kind in INERTIAL)
        return Inertia(m, (x, y, z), *tensor)

    def parameter(self, position: int) -> Scalar:
        """A parameter, zero where it is dropped."""
        if position in self._dropped:
            return self.number(0.0)
        return Scalar(self.graph, self.graph.input(position))

    def no_inertia(self) -> Inertia:
        """The inertia of a body without mass."""
        zero = self.number(0.0)
        return Inertia(zero, (zero, zero, zero), *[zero] * 6)


@dataclass(frozen=True)
class Angle:
    """An angle about z with its derivatives; constant parts are kept apart."""

    sum: Scalar
    offset: float
    speed: Scalar
    acceleration: Scalar


@dataclass(frozen=True)
class JointState:
    """The kinematics at one joint.

    The frame at rest is the one the body's angle is measured against: that of the joint, or
    where parallel axes are aligned, that of the first of them.
    """

    joint: Joint
    aligned: bool
    rest_to_parent: ConstantTurn
    """From the frame at rest to that of the body before; of no use where aligned."""
    angle: Angle
    turn: Turn
    """Of the body against the frame at rest."""
    rest_motion: FrameMotion
    """Of the frame at rest, in its components."""
    body_motion: FrameMotion
    """Of the body's frame, in its own."""
    joint_turning: Turning
    """What U of the body has on top of U of the frame at rest."""
    rest_acceleration: Vector
    """Acceleration of the origin less gravity, in the frame at rest."""
    body_acceleration: Vector
    """The same in the body's frame."""
    reach: Vector
    """From the origin before: in the frame of the body before, or aligned, in that at rest."""
    relative_acceleration: Vector
    """Acceleration of the origin against the frame before that ``reach`` is given in; at rest."""


class Kinematics:
    """States of all joints of a tree.

    Args:
        tree: The tree.
        choices: One per joint.
        graph: Where the expressions go.
        moving: Whether joints accelerate.
        dropped: Positions of parameters that are zero.
    """

    def __init__(
        self,
        tree: Tree,
        choices: Sequence[JointFormulation],
        graph: Graph,
        *,
        moving: bool = True,
        dropped: Collection[int] = (),
    ) -> None:
        self.tree, self.choices, self.graph = tree, choices, graph
        self.symbols = Symbols(graph, tree, dropped)
        self._zero = self.symbols.number(0.0)
        self._none = self.symbols.vector((0, 0, 0))
        self._moving = moving
        omega, rate, acceleration = self._none, self._none, self.symbols.vector(-tree.gravity)
        if tree.carried:
            omega, rate, acceleration = self.symbols.carrying()
        self._base = motion(omega, rate), acceleration
        self._screws: dict[int, dict[int, tuple[Vector, Vector]]] = {}
        self.states: list[JointState] = []
        for i in range(len(tree.joints)):
            self.states.append(self._state(i))

    def body(self, i: int) -> Inertia:
        """The parameters of a body with its payloads in the frame on its joint."""
        joint = self.tree.joints[i]
        whole = self.symbols.no_inertia()
        for rigid in joint.rigid:
            frame = joint.described_to_axis @ rigid.frame
            turn = constant_turn(self.graph, clean_rotation(frame[:3, :3]).tobytes())
            described = turn.inertia(self.symbols.inertia(rigid))
            whole = whole + described.shifted(self.symbols.vector(frame[:3, 3]))
        return whole

    def _state(self, i: int) -> JointState:
        joint, choice = self.tree.joints[i], self.choices[i]
        before = None if joint.parent == BASE else self.states[joint.parent]
        fixed = constant_turn(self.graph, joint.turn.tobytes())
        place = self.symbols.vector(joint.place)
        aligned = before is not None and joint.parallel and choice.aligned
        if aligned and before is not None:
            rest, reach = before.rest_motion, before.turn.out(place)
            extra = before.joint_turning.moved(reach)
            a = add(before.rest_acceleration, before.turn.out(before.body_motion.moved(place)))
            if choice.reach_turned:
                a = add(add(before.rest_acceleration, before.rest_motion.moved(reach)), extra)
        else:
            carrier, a = self._base
            if before is not None:
                carrier, a = before.body_motion, before.body_acceleration
            rest, reach, extra = seen_through(fixed, carrier), place, self._none
            a = fixed.back(add(a, carrier.moved(place)))
        q, dq, ddq = (joint.sign * self.symbols.coordinate(i, k) for k in range(3))
        if not self._moving:
            ddq = self._zero
        angle = before.angle if aligned and before is not None else self._no_angle()
        if joint.revolute:
            angle = Angle(
                angle.sum + q,
                angle.offset + joint.offset,
                angle.speed + dq,
                angle.acceleration + ddq,
            )
        else:
            sliding, distance = slide(rest, dq, ddq), q + joint.offset
            x, y, z = (distance * component for component in rest.along_z())
            a, extra = add(add(a, sliding), (x, y, z)), add(extra, sliding)
            step = (self._zero, self._zero, distance)
            reach = add(reach, step if aligned else fixed.out(step))
        turn = turn_by(angle.sum, angle.offset)
        return JointState(
            joint=joint,
            aligned=aligned,
            rest_to_parent=fixed,
            angle=angle,
            turn=turn,
            rest_motion=rest,
            body_motion=turned(
                rest, turn, angle.speed, angle.acceleration, choice.diagonal, choice.rates
            ),
            joint_turning=turning(rest, angle.speed, angle.acceleration),
            rest_acceleration=a,
            body_acceleration=turn.back(a),
            reach=reach,
            relative_acceleration=extra,
        )

    def _no_angle(self) -> Angle:
        return Angle(self._zero, 0.0, self._zero, self._zero)

    def screws(self, i: int) -> dict[int, tuple[Vector, Vector]]:
        """How the joints before joint i move its origin.

        Returns:
            For each of them the angular velocity and the velocity of the origin for a unit speed,
            in the frame at rest of joint i.
        """
        if i not in self._screws:
            self._screws[i] = self._found_screws(i)
        return self._screws[i]

    def _found_screws(self, i: int) -> dict[int, tuple[Vector, Vector]]:
        state = self.states[i]
        parent = state.joint.parent
        if parent == BASE:
            return {}
        before = self.states[parent]
        one = self.symbols.number(1.0)
        axis = (self._zero, self._zero, one)
        own = (axis, self._none) if before.joint.revolute else (self._none, axis)
        known = self.screws(parent)
        if not state.aligned:
            known = {j: (before.turn.back(w), before.turn.back(v)) for j, (w, v) in known.items()}
        screws = {**known, parent: own}
        moved = {j: (w, add(v, cross(w, state.reach))) for j, (w, v) in screws.items()}
        if state.aligned:
            return moved
        back = state.rest_to_parent.back
        return {j: (back(w), back(v)) for j, (w, v) in moved.items()}

    def rest_components(self, i: int) -> FrameMotion:
        """FrameMotion of a body in the components of its frame at rest."""
        state, choice = self.states[i], self.choices[i]
        still = Turn(self.symbols.number(1.0), self._zero)
        angle = state.angle
        return turned(
            state.rest_motion, still, angle.speed, angle.acceleration, choice.diagonal, choice.rates
        )
