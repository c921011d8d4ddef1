"""The motion of every frame of a tree, as the choices at its joints say."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.expressions.vectors import Vector, add, cross
from paramreduce_cli.lean.algebra import Scalar
from paramreduce_cli.lean.frame_motion import (
    FrameMotion,
    RotationEffect,
    accelerate_along_z,
    add_rotation,
    change_components,
    make_frame_motion,
    make_rotation_effect,
)
from paramreduce_cli.lean.inertia_expressions import Inertia
from paramreduce_cli.lean.joint_formulations import JointFormulation
from paramreduce_cli.lean.joint_frames import Joint, Tree
from paramreduce_cli.lean.rotations import (
    ConstantRotation,
    JointRotation,
    make_constant_rotation,
    make_joint_rotation,
)
from paramreduce_cli.records import BASE, INERTIAL, FloatArray, Rigid
from paramreduce_cli.robots.frames import clean_rotation


class Symbols:
    """The inputs of all models of a tree: parameters first, then q, dq and ddq.

    Args:
        graph: Graph of the symbols.
        tree: Tree of the models.
        dropped: Positions of parameters that are zero.
    """

    def __init__(self, graph: Graph, tree: Tree, dropped: Collection[int] = ()) -> None:
        self.graph = graph
        self._dropped = frozenset(dropped)
        self._start = tree.n_parameters
        self._joints = tree.joints

    def make_constant(self, value: float) -> Scalar:
        """Return a number that is known when the code is written."""
        return Scalar(self.graph, self.graph.constant(value))

    def make_vector(self, values: Sequence[float] | FloatArray) -> Vector:
        """Return three constants as a vector."""
        x, y, z = (self.make_constant(float(value)) for value in values)
        return (x, y, z)

    def read_coordinate(self, i: int, derivative: int) -> Scalar:
        """Return the coordinate of joint i in the sign of the robot's description, or its first or second derivative."""
        position = self._start + derivative * len(self._joints) + i
        return Scalar(self.graph, self.graph.input(position))

    def read_base_motion(self) -> tuple[Vector, Vector, Vector]:
        """Return angular velocity, angular acceleration and acceleration less gravity of a moving base."""
        start = self._start + 3 * len(self._joints)
        values = [Scalar(self.graph, self.graph.input(start + k)) for k in range(9)]
        x, y, z = ((a, b, c) for a, b, c in zip(*[iter(values)] * 3, strict=True))
        return x, y, z

    def read_inertia(self, rigid: Rigid) -> Inertia:
        """Return the parameters of a body or payload, in its frame as described."""
        m, x, y, z, *tensor = (self.read_parameter(rigid.columns[kind]) for kind in INERTIAL)
        return Inertia(m, (x, y, z), *tensor)

    def read_parameter(self, position: int) -> Scalar:
        """Return a parameter, zero if it is dropped."""
        if position in self._dropped:
            return self.make_constant(0.0)
        return Scalar(self.graph, self.graph.input(position))

    def make_zero_inertia(self) -> Inertia:
        """Return the inertia of a body without mass."""
        zero = self.make_constant(0.0)
        return Inertia(zero, (zero, zero, zero), *[zero] * 6)


class RestSymbols(Symbols):
    """The inputs of a tree at rest whose parameters are known numbers.

    Args:
        graph: Graph of the symbols.
        tree: Tree of the models.
        values: Values of the parameters, (n_parameters,).
    """

    def __init__(self, graph: Graph, tree: Tree, values: FloatArray) -> None:
        super().__init__(graph, tree)
        self._values = values

    def read_coordinate(self, i: int, derivative: int) -> Scalar:
        """Return the coordinate of joint i in the sign of the robot's description, or zero for its derivatives."""
        return self.make_constant(0.0) if derivative else super().read_coordinate(i, derivative)

    def read_parameter(self, position: int) -> Scalar:
        """Return the value of a parameter."""
        return self.make_constant(float(self._values[position]))


@dataclass(frozen=True)
class Angle:
    """An angle about z and its derivatives; its constant part is kept apart."""

    sum: Scalar
    offset: float
    speed: Scalar
    acceleration: Scalar


@dataclass(frozen=True)
class JointState:
    """A record of the kinematics at one joint.

    Its frame at rest is the frame that the body's angle is measured against: that of the joint, or, where parallel axes
    are aligned, that of the first of them.
    """

    joint: Joint
    aligned: bool
    rest_to_parent: ConstantRotation
    """Rotation from the frame at rest to that of the parent body; unused if axes are aligned."""
    angle: Angle
    rotation: JointRotation
    """Rotation of the body against the frame at rest."""
    rest_motion: FrameMotion
    """Motion of the frame at rest, in its own components."""
    body_motion: FrameMotion
    """Motion of the body's frame, in its own components."""
    joint_turning: RotationEffect
    """Difference between U of the body and U of the frame at rest."""
    rest_acceleration: Vector
    """Acceleration of the origin less gravity, in the frame at rest."""
    body_acceleration: Vector
    """Acceleration of the origin less gravity, in the body's frame."""
    reach: Vector
    """Vector from the parent's origin: in the parent's frame, or if aligned, in the frame at rest."""
    relative_acceleration: Vector
    """Acceleration of the origin relative to the frame that ``reach`` is given in, in the frame at rest."""


class Kinematics:
    """The motion of all joints of a tree.

    Args:
        tree: The tree.
        choices: Formulations, one per joint.
        symbols: Inputs of the model, in the graph that expressions are added to.
        moving: Whether joints accelerate.
    """

    def __init__(
        self,
        tree: Tree,
        choices: Sequence[JointFormulation],
        symbols: Symbols,
        *,
        moving: bool = True,
    ) -> None:
        self.tree, self.choices, self.graph = tree, choices, symbols.graph
        self.symbols = symbols
        self._zero = self.symbols.make_constant(0.0)
        self._none = self.symbols.make_vector((0, 0, 0))
        self._moving = moving
        omega, rate, acceleration = self._none, self._none, self.symbols.make_vector(-tree.gravity)
        if tree.carried:
            omega, rate, acceleration = self.symbols.read_base_motion()
        self._base = make_frame_motion(omega, rate), acceleration
        self._screws: dict[int, dict[int, tuple[Vector, Vector]]] = {}
        self.states: list[JointState] = []
        for i in range(len(tree.joints)):
            self.states.append(self._make_state(i))

    def sum_body_inertia(self, i: int) -> Inertia:
        """Return the inertia of a body with its payloads, in the body's frame that ``choose_frames`` has put on the
        joint's axis.
        """
        joint = self.tree.joints[i]
        whole = self.symbols.make_zero_inertia()
        for rigid in joint.rigid:
            frame = joint.described_to_axis @ rigid.frame
            rotation = make_constant_rotation(self.graph, clean_rotation(frame[:3, :3]).tobytes())
            described = rotation.rotate_inertia(self.symbols.read_inertia(rigid))
            whole = whole + described.move_point(self.symbols.make_vector(frame[:3, 3]))
        return whole

    def _make_state(self, i: int) -> JointState:
        """Return the motion of the frames at joint i; the parent's must have been computed."""
        joint, choice = self.tree.joints[i], self.choices[i]
        before = None if joint.parent == BASE else self.states[joint.parent]
        fixed = make_constant_rotation(self.graph, joint.rotation.tobytes())
        place = self.symbols.make_vector(joint.place)
        aligned = before is not None and joint.parallel and choice.aligned
        if aligned and before is not None:
            rest, reach = before.rest_motion, before.rotation.to_parent(place)
            extra = before.joint_turning.multiply(reach)
            a = add(
                before.rest_acceleration,
                before.rotation.to_parent(before.body_motion.multiply(place)),
            )
            if choice.reach_turned:
                a = add(add(before.rest_acceleration, before.rest_motion.multiply(reach)), extra)
        else:
            carrier, a = self._base
            if before is not None:
                carrier, a = before.body_motion, before.body_acceleration
            rest, reach, extra = change_components(fixed, carrier), place, self._none
            a = fixed.to_child(add(a, carrier.multiply(place)))
        q, dq, ddq = (joint.sign * self.symbols.read_coordinate(i, k) for k in range(3))
        if not self._moving:
            ddq = self._zero
        angle = before.angle if aligned and before is not None else self._make_zero_angle()
        if joint.revolute:
            angle = Angle(
                angle.sum + q,
                angle.offset + joint.offset,
                angle.speed + dq,
                angle.acceleration + ddq,
            )
        else:
            sliding, distance = accelerate_along_z(rest, dq, ddq), q + joint.offset
            x, y, z = (distance * component for component in rest.multiply_z())
            a, extra = add(add(a, sliding), (x, y, z)), add(extra, sliding)
            step = (self._zero, self._zero, distance)
            reach = add(reach, step if aligned else fixed.to_parent(step))
        rotation = make_joint_rotation(angle.sum, angle.offset)
        return JointState(
            joint=joint,
            aligned=aligned,
            rest_to_parent=fixed,
            angle=angle,
            rotation=rotation,
            rest_motion=rest,
            body_motion=add_rotation(
                rest, rotation, angle.speed, angle.acceleration, choice.diagonal, choice.rates
            ),
            joint_turning=make_rotation_effect(rest, angle.speed, angle.acceleration),
            rest_acceleration=a,
            body_acceleration=rotation.to_child(a),
            reach=reach,
            relative_acceleration=extra,
        )

    def _make_zero_angle(self) -> Angle:
        return Angle(self._zero, 0.0, self._zero, self._zero)

    def find_screws(self, i: int) -> dict[int, tuple[Vector, Vector]]:
        """Return the motion of the origin of joint i that each joint before it causes.

        Returns:
            Angular velocity and velocity of the origin for a unit speed of each joint,
            in the frame at rest of joint i.
        """
        if i not in self._screws:
            self._screws[i] = self._compute_screws(i)
        return self._screws[i]

    def _compute_screws(self, i: int) -> dict[int, tuple[Vector, Vector]]:
        """Return the screws of joint i from the screws of its parent."""
        state = self.states[i]
        parent = state.joint.parent
        if parent == BASE:
            return {}
        before = self.states[parent]
        one = self.symbols.make_constant(1.0)
        axis = (self._zero, self._zero, one)
        own = (axis, self._none) if before.joint.revolute else (self._none, axis)
        known = self.find_screws(parent)
        if not state.aligned:
            known = {
                j: (before.rotation.to_child(w), before.rotation.to_child(v))
                for j, (w, v) in known.items()
            }
        screws = {**known, parent: own}
        moved = {j: (w, add(v, cross(w, state.reach))) for j, (w, v) in screws.items()}
        if state.aligned:
            return moved
        to_child = state.rest_to_parent.to_child
        return {j: (to_child(w), to_child(v)) for j, (w, v) in moved.items()}

    def express_at_rest(self, i: int) -> FrameMotion:
        """Return the motion of a body in the components of its frame at rest."""
        state, choice = self.states[i], self.choices[i]
        still = JointRotation(self.symbols.make_constant(1.0), self._zero)
        angle = state.angle
        return add_rotation(
            state.rest_motion, still, angle.speed, angle.acceleration, choice.diagonal, choice.rates
        )
