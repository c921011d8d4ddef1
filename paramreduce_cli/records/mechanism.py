"""Mechanisms: bodies, joints, drives, and closures of loops."""

from collections.abc import Collection, Mapping
from functools import cached_property
from typing import Literal

import numpy as np

from paramreduce_cli.records.arrays import FloatArray, IntArray
from paramreduce_cli.records.parameters import (
    DRIVE,
    INERTIAL,
    Kind,
    Parameter,
    order_by_preference,
    to_latex_subscript,
)
from paramreduce_cli.records.representation import record

BASE = -1
"""Index of the fixed base in :attr:`Body.parent`."""

JOINT_COORDINATES = {"revolute": 1, "prismatic": 1, "universal": 2, "spherical": 3, "free": 6}
"""How many coordinates each kind of joint has."""

JOINT_AXES = {"revolute": 1, "prismatic": 1, "universal": 2, "spherical": 0, "free": 0}
"""How many axes each kind of joint can be given."""


@record
class Body:
    """A body and the joint that connects it to its parent.

    Seen from the parent's frame, the body's frame is
    ``parent_to_joint * motion * joint_to_body``; the motion is a rotation about z (revolute) or a
    translation along z (prismatic).
    """

    name: str
    parent: int
    """Index of the parent body, :data:`BASE` for the base."""
    joint: Literal["revolute", "prismatic"]
    parent_to_joint: FloatArray
    """Homogeneous transform of the joint's frame at rest in the parent's frame, (4, 4), m."""
    joint_to_body: FloatArray
    """Homogeneous transform of the body's frame in the moved joint's frame, (4, 4), m."""
    coordinate: str
    """Name of the joint's coordinate."""
    offset: float = 0.0
    """Added to the coordinate, rad or m."""
    intermediate: bool = False
    """Whether it is but a frame between the axes of one joint."""

    @property
    def unit(self) -> str:
        """Unit of the joint's coordinate."""
        return "rad" if self.joint == "revolute" else "m"


ClosureKind = Literal[
    "fixed", "revolute", "prismatic", "cylindrical", "universal", "point", "planar", "distance",
    "coupling",
]  # fmt: skip


@record
class Closure:
    """A closure that holds two bodies of the tree together and makes a loop.

    With A and B the frames on the two bodies:

    * ``fixed``: they coincide, six equations;
    * ``revolute``: their origins and z axes coincide, five equations;
    * ``prismatic``: they coincide but for a shift along z, five equations;
    * ``cylindrical``: their z axes coincide, four equations;
    * ``universal``: their origins coincide, x of A stays perpendicular to y of B, four equations;
    * ``point``: their origins coincide, three equations;
    * ``planar``: the origin of B is on the z axis of A, two equations;
    * ``distance``: their origins are ``length`` apart, one equation;
    * ``coupling``: the coordinate of the second body's joint is ``ratio`` times that of the first one's
      plus ``offset``, one equation; frames do not matter.
    """

    name: str
    kind: ClosureKind
    bodies: tuple[int, int]
    """Indices of the two bodies, :data:`BASE` for the base."""
    frames: tuple[FloatArray, FloatArray]
    """Homogeneous transforms of A and B in the frames of their bodies, (4, 4), m."""
    length: float = 0.0
    """Length of a ``distance``, m."""
    ratio: float = 1.0
    """Ratio of a ``coupling``."""
    offset: float = 0.0
    """Offset of a ``coupling``, rad or m."""


@record
class Loops:
    """The closures of a mechanism's loops, and the coordinates that describe the mechanism."""

    closures: tuple[Closure, ...]
    independent: tuple[int, ...]
    """Indices of the bodies whose coordinates are independent; these are actuated."""
    assembly: FloatArray
    """Generalised coordinates near which, or in which, the loops are closed, (n_q,)."""
    kept: tuple[int, ...] | None = None
    """Numbers of the closures' equations that all others follow from; None for all."""


@record
class Payload:
    """A payload: a rigid body with parameters of its own, in a frame fixed to the body that carries it."""

    name: str
    body: int
    """Index of the body that carries it."""
    frame: FloatArray
    """Homogeneous transform of its frame in the body's, (4, 4), m."""


MotionKind = Literal["distance", "shift", "turn", "slip", "sideslip"]


@record
class MotionBetween:
    """A motion between a frame A on one body and a frame B on another.

    * ``distance``: the distance between the origins;
    * ``shift``: the component along an axis of A of the vector from A to B, m;
    * ``turn``: the component along an axis of A of the small rotation of B against A, the sine of its angle;
    * ``slip``: the velocity of a wheel's contact point along the direction in which the wheel rolls, less radius times spin;
    * ``sideslip``: the velocity of the contact point across this direction.

    For slips, B is the centre of the wheel with y along its axle, on a body that does not spin. The z axis of A is normal to
    the road. The creepage is the velocity over the speed of the contact point along the rolling direction.
    """

    kind: MotionKind
    bodies: tuple[int, int]
    """Indices of the two bodies, :data:`BASE` for the base."""
    frames: tuple[FloatArray, FloatArray]
    """Homogeneous transforms of A and B in the frames of their bodies, (4, 4), m."""
    axis: int = 0
    """Axis of A for a shift or a turn: 0, 1 or 2."""
    radius: float = 0.0
    """Radius of a wheel, m."""
    spin: int = -1
    """Index of the coordinate that the wheel spins by, about y of B; -1 without one."""
    low_speed: float = 0.0
    """Speed v0 that creepages are divided by at rest: the divisor is sqrt(v^2 + v0^2), m/s."""


@record
class Drive:
    """A drive or force element: rotor, friction, constant force, spring, damper or creep along one motion.

    The motion is that of ``between``, or its speed is a weighted sum of the coordinates' speeds. A force f along the motion
    is f times the derivative of its speed by each coordinate's speed, so that power is force times speed.
    """

    name: str
    weights: FloatArray
    """Weights of the generalised coordinates, (n_q,); zeros for a motion between frames."""
    smoothing: float = 0.0
    """Speed s at which Coulomb friction, tanh(speed / s), is 76 %; zero for the sign of the speed."""
    rest: float = 0.0
    """Position where the spring is slack, rad or m; NaN until a static equilibrium decides."""
    stribeck_velocity: float = 0.1
    """Speed s beyond which the Stribeck friction, which has the factor sign(speed) - tanh(speed / s), fades."""
    spring_table: FloatArray | None = None
    """Positions less ``rest``, ascending, and forces of a piecewise linear spring, (n_points, 2)."""
    damper_table: FloatArray | None = None
    """Speeds and forces of a piecewise linear damper, (n_points, 2), speeds ascending."""
    creepage: FloatArray | None = None
    """Weights of the coordinates and of their speeds in the creepage of a linear contact, (2, n_q)."""
    between: MotionBetween | None = None
    """Motion between two frames; None for a weighted sum of coordinates."""


@record
class Rigid:
    """A rigid body in a mechanism: one of its bodies, or a payload."""

    name: str
    body: int
    """Index of the body it moves with."""
    frame: FloatArray
    """Homogeneous transform of its frame in that body's, (4, 4), m."""
    columns: Mapping[Kind, int]
    """Columns of its parameters by kind."""


@record
class Length:
    """A length of the geometry, such as a_3 of a Denavit-Hartenberg table."""

    symbol: str
    owner: str
    """Name of the body it is of."""
    value: float
    """m"""

    @property
    def name(self) -> str:
        """Symbol and owner."""
        return f"{self.symbol}_{self.owner}"

    @property
    def latex(self) -> str:
        """LaTeX formula of the length."""
        return f"{self.symbol}_{{{to_latex_subscript(self.owner)}}}"


@record
class Mechanism:
    """A tree of bodies on a fixed base, perhaps with loops; parents come before their children."""

    robot: str
    bodies: tuple[Body, ...]
    parameters: tuple[Parameter, ...]
    """The columns of its observation matrix, in order; (n_parameters,)."""
    gravity: FloatArray
    """Acceleration of gravity in the base frame, (3,), m/s^2."""
    lengths: tuple[Length, ...]
    """Named lengths of the geometry; relations between parameters are printed in them."""
    table: tuple[tuple[str, ...], ...]
    """The geometry as the user wrote it, a header row first; for people."""
    loops: Loops | None = None
    """None for an open tree, all of whose coordinates are independent."""
    payloads: tuple[Payload, ...] = ()
    """Payloads of the bodies."""
    drives: tuple[Drive, ...] = ()
    """Rotors, friction and springs."""
    frames: str = ""
    """Frames of the table, in words."""
    nominal: FloatArray | None = None
    """Nominal values of the parameters, (n_parameters,): friction that depends on the load grows with the torques of gravity
    that these have. None without such friction."""

    @property
    def n_q(self) -> int:
        """Number of generalised coordinates, one for every body."""
        return len(self.bodies)

    @property
    def independent(self) -> tuple[int, ...]:
        """Indices of the independent ones among the generalised coordinates."""
        return self.loops.independent if self.loops is not None else tuple(range(self.n_q))

    @property
    def dependent(self) -> tuple[int, ...]:
        """Indices of the generalised coordinates that the loops determine."""
        return tuple(k for k in range(self.n_q) if k not in self.independent)

    @property
    def n_dof(self) -> int:
        """Number of independent coordinates."""
        return len(self.independent)

    @property
    def n_parameters(self) -> int:
        """Number of parameters."""
        return len(self.parameters)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters, in order."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def preference_order(self) -> IntArray:
        """Parameters from the most to the least wanted as base parameters, (n_parameters,)."""
        return order_by_preference([parameter.preference for parameter in self.parameters])

    @property
    def size(self) -> float:
        """Sum of all distances between joints, bodies and payloads, m; one if there are none."""
        frames = [
            frame for body in self.bodies for frame in (body.parent_to_joint, body.joint_to_body)
        ]
        frames += [payload.frame for payload in self.payloads]
        return float(sum(np.linalg.norm(frame[:3, 3]) for frame in frames)) or 1.0

    @property
    def symbols(self) -> dict[str, str]:
        """Formulas of parameters and lengths by their names."""
        items: tuple[Parameter | Length, ...] = (*self.parameters, *self.lengths)
        return {item.name: item.latex for item in items}

    @cached_property
    def rigid(self) -> tuple[Rigid, ...]:
        """Everything that has inertia, the bodies first."""
        bodies = [(body.name, k, np.eye(4)) for k, body in enumerate(self.bodies)]
        payloads = [(payload.name, payload.body, payload.frame) for payload in self.payloads]
        found = (
            Rigid(name, body, frame, self._find_columns(name, INERTIAL))
            for name, body, frame in bodies + payloads
        )
        return tuple(rigid for rigid in found if rigid.columns)

    def list_rigid_parts(self, body: int) -> tuple[Rigid, ...]:
        """Return a body and its payloads, as far as they have inertia."""
        return tuple(rigid for rigid in self.rigid if rigid.body == body)

    def find_drive_columns(self, drive: Drive) -> Mapping[Kind, int]:
        """Return the columns of a drive's parameters by kind."""
        return self._find_columns(drive.name, DRIVE)

    def _find_columns(self, owner: str, kinds: Collection[Kind]) -> Mapping[Kind, int]:
        """Return the columns of an owner's parameters of some kinds, by kind."""
        columns = self._columns.get(owner, {})
        return {kind: column for kind, column in columns.items() if kind in kinds}

    @cached_property
    def _columns(self) -> Mapping[str, Mapping[Kind, int]]:
        """Columns of all parameters by owner and kind."""
        columns: dict[str, dict[Kind, int]] = {}
        for column, parameter in enumerate(self.parameters):
            columns.setdefault(parameter.owner, {})[parameter.kind] = column
        return columns

    @property
    def generalised_names(self) -> tuple[str, ...]:
        """Names of the generalised coordinates."""
        return tuple(body.coordinate for body in self.bodies)

    @property
    def coordinate_names(self) -> tuple[str, ...]:
        """Names of the independent coordinates."""
        return tuple(self.bodies[k].coordinate for k in self.independent)
