"""Frozen records that pass between stages, and the arrays they are made of.

A record holds data and what follows from it directly; no numerics, no files.
Units are SI throughout: m, rad, s, kg, kg m, kg m^2, N, N m.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, MutableMapping
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

PARAMETER_KINDS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
"""The standard parameters of one body, in the order every array uses."""

BASE = -1
"""Index of the fixed base in :attr:`Body.parent`."""

JOINT_COORDINATES = {"revolute": 1, "prismatic": 1, "universal": 2, "spherical": 3, "free": 6}
"""How many coordinates each kind of joint has."""

JOINT_AXES = {"revolute": 1, "prismatic": 1, "universal": 2, "spherical": 0, "free": 0}
"""How many axes each kind of joint can be given."""


@dataclass(frozen=True)
class Body:
    """A body and the joint that connects it to its parent.

    The body frame is ``before * motion * after`` seen from the parent's frame; the
    motion is a rotation about z (revolute) or a translation along z (prismatic).
    """

    name: str
    parent: int
    """Index of the parent body, :data:`BASE` for the base."""
    joint: Literal["revolute", "prismatic"]
    before: FloatArray
    """Homogeneous transform from the parent's frame to the joint, (4, 4), m."""
    after: FloatArray
    """Homogeneous transform from the moved joint to the body's frame, (4, 4), m."""
    coordinate: str
    """Name of the joint's coordinate."""
    offset: float = 0.0
    """Added to the coordinate, rad or m."""
    massless: bool = False
    """Whether it has no parameters: a frame between the axes of one joint, or a body without mass."""


@dataclass(frozen=True)
class Closure:
    """What holds two bodies of the tree together and makes a loop of it.

    With A and B the frames on the two bodies:

    * ``point``: their origins coincide, three equations;
    * ``planar``: the origin of B is on the z axis of A, two equations;
    * ``revolute``: their origins and z axes coincide, five equations;
    * ``distance``: their origins are ``length`` apart, one equation.
    """

    name: str
    kind: Literal["point", "planar", "revolute", "distance"]
    bodies: tuple[int, int]
    """Indices of the two bodies, :data:`BASE` for the base."""
    frames: tuple[FloatArray, FloatArray]
    """Homogeneous transforms of A and B in the frames of their bodies, (4, 4), m."""
    length: float = 0.0
    """Of a ``distance``, m."""


@dataclass(frozen=True)
class Loops:
    """How the loops of a mechanism are closed, and in which coordinates it is described."""

    closures: tuple[Closure, ...]
    independent: tuple[int, ...]
    """Indices of the bodies whose coordinates are independent; these are actuated."""
    assembly: FloatArray
    """Generalised coordinates near which, or in which, the loops are closed, (n_q,)."""


@dataclass(frozen=True)
class Mechanism:
    """A tree of bodies on a fixed base, perhaps with loops; parents come before their children."""

    robot: str
    bodies: tuple[Body, ...]
    gravity: FloatArray
    """Acceleration of gravity in the base frame, (3,), m/s^2."""
    lengths: Mapping[str, float]
    """Named lengths of the geometry, m; relations between parameters are printed in them."""
    table: tuple[tuple[str, ...], ...]
    """The geometry as the user wrote it, a header row first; for people."""
    loops: Loops | None = None
    """None for an open tree, all of whose coordinates are independent."""

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
    def inertial(self) -> tuple[int, ...]:
        """Indices of the bodies that have parameters."""
        return tuple(k for k, body in enumerate(self.bodies) if not body.massless)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the standard parameters, body by body."""
        names = (self.bodies[k].name for k in self.inertial)
        return tuple(f"{kind}_{name}" for name in names for kind in PARAMETER_KINDS)

    @property
    def generalised_names(self) -> tuple[str, ...]:
        """Names of the generalised coordinates."""
        return tuple(body.coordinate for body in self.bodies)

    @property
    def coordinate_names(self) -> tuple[str, ...]:
        """Names of the independent coordinates."""
        return tuple(self.bodies[k].coordinate for k in self.independent)


@dataclass(frozen=True)
class Constraint:
    """Bounds on a quantity of the mechanism along a trajectory.

    What ``bodies`` and ``vectors`` mean depends on the kind:

    * ``coordinate``: the body whose coordinate is bounded, rad or m;
    * ``angle``: two bodies and a direction in the frame of each, rad;
    * ``distance``: two bodies and a point in the frame of each, m;
    * ``distance-from-axis``: a body and the body that carries the axis; a point in the frame of
      the first, a point and the direction of the axis in the frame of the second, m;
    * ``singularity``: none; distance to singularity of the loops, 0 to 1.
    """

    name: str
    kind: Literal["coordinate", "angle", "distance", "distance-from-axis", "singularity"]
    bodies: tuple[int, ...]
    vectors: tuple[FloatArray, ...]
    lower: float
    """Minus infinity where there is none."""
    upper: float


@dataclass(frozen=True)
class BaseParameters:
    """A choice of independent columns of W and the relations of the others to them."""

    columns: IntArray
    """Indices of the independent columns, (r,)."""
    beta: FloatArray
    """W[:, others] = W[:, columns] @ beta with the others in ascending order, (r, n - r)."""
    singular_values: FloatArray
    """Of W with its columns scaled to unit length, descending."""
    rank_gap: float
    """Last singular value kept over the first one dropped; infinite where none was dropped."""
    expressions: tuple[str, ...] = ()
    """Each base parameter in terms of standard ones, for people."""


@dataclass(frozen=True)
class Formulations:
    """Lean ways to write a mechanism's dynamics: for each, what is chosen at every joint."""

    inverse: tuple[tuple[Mapping[str, str | bool], ...], ...]
    direct: tuple[tuple[Mapping[str, str | bool], ...], ...]


@dataclass(frozen=True)
class Model:
    """A mechanism with its standard parameters and their base."""

    mechanism: Mechanism
    values: FloatArray
    """Standard parameters, (n,), kg, kg m, kg m^2."""
    affecting: BoolArray
    """Which parameters change the torques at all, (n,)."""
    base: BaseParameters
    nominal_torque: FloatArray
    """Characteristic size of each joint's torque or force, (n_dof,), N m or N."""
    nominal_torque_given: bool
    """Whether the config gave it; if not, the estimation set's replaces it from `sample` on."""
    formulations: Formulations


@dataclass(frozen=True)
class Trajectory:
    """One optimised finite Fourier series with what was asked of it and how it went."""

    coefficients: FloatArray
    """[q0, a1, b1, a2, b2, ...] per joint, (n_dof, 1 + 2 harmonics)."""
    kappa: float
    """Condition number in the scaling the config asked for."""
    kappa_start: float
    """The same at the random start it came from."""
    kappa_variants: Mapping[str, float]
    peak_position: FloatArray
    """Largest distance from the middle of the position range, (n_dof,), rad or m."""
    peak_velocity: FloatArray
    """(n_dof,), rad/s or m/s."""
    reach: FloatArray
    """Largest share of half the position range, or of the velocity or acceleration limit, that the
    motion about its offset uses, (n_dof,)."""
    extremes: FloatArray
    """Smallest and largest value of every bounded quantity, (n_constraints, 2), in its unit."""
    cpu_seconds: float
    iterations: int
    status: str


@dataclass(frozen=True)
class Trajectories:
    """The trajectories of the estimation and of the validation set."""

    period: float
    criterion: str
    scaling: str
    constraints: tuple[Constraint, ...]
    """What the trajectories had to keep to, besides the limits of the independent coordinates."""
    estimation: tuple[Trajectory, ...]
    validation: tuple[Trajectory, ...]


@dataclass(frozen=True)
class Coefficients:
    """Fourier coefficients brought by the user, each (n_traj, n_dof, 1 + 2 harmonics)."""

    source: str
    period: float
    estimation: FloatArray
    validation: FloatArray


@dataclass(frozen=True)
class Recording:
    """States, and perhaps measured torques, brought by the user; each (n_samples, n_dof)."""

    source: str
    time: FloatArray
    z: FloatArray
    dz: FloatArray
    ddz: FloatArray
    tau: FloatArray | None


@dataclass(frozen=True)
class Recordings:
    """What the user brought for either set."""

    estimation: Recording | None
    validation: Recording | None


@dataclass(frozen=True)
class Block:
    """Consecutive samples of one trajectory."""

    trajectory: int
    time: FloatArray
    """(n_samples,), s."""
    z: FloatArray
    dz: FloatArray
    ddz: FloatArray
    tau: FloatArray
    """Torques of the full model, or measured ones; like the states (n_samples, n_dof)."""
    q: FloatArray
    """Generalised coordinates, (n_samples, n_q); the independent ones where there are no loops."""
    dq: FloatArray
    ddq: FloatArray
    W: FloatArray
    """(n_samples * n_dof, n_parameters), sample-major."""


class SampleSet(Protocol):
    """A set of samples that is read block by block, so that memory stays flat."""

    @property
    def n_samples(self) -> int:
        """Samples over all trajectories."""

    def blocks(self) -> Iterator[Block]:
        """Yield the samples in order; every call starts anew."""

    def factors(self) -> FloatArray:
        """Triangular factors of [W | tau] per trajectory and joint.

        Shape (n_trajectories, n_dof, n_parameters + 1, n_parameters + 1).
        """


@dataclass(frozen=True)
class Samples:
    """The estimation and validation sets with the scales their errors are measured in."""

    names: tuple[str, ...]
    values: FloatArray | None
    """Standard parameters, (n,), where they are known."""
    nominal_torque: FloatArray | None
    """(n_dof,); without it the standard deviation over the estimation set is meant."""
    nominal_acceleration: FloatArray | None
    """(n_dof,); without it the standard deviation over the estimation set is meant."""
    estimation: SampleSet
    validation: SampleSet | None


@dataclass(frozen=True)
class BySize:
    """Arrays with one row for every size of subset."""

    n: IntArray
    """Sizes of the subsets: 1, 2, ... unless columns are chosen in groups, (m,)."""

    def row(self, n: int) -> int | None:
        """Where the subset of size n stands in the arrays; None if there is none."""
        rows = np.flatnonzero(self.n == n)
        return int(rows[0]) if rows.size else None


@dataclass(frozen=True)
class Subsets(BySize):
    """What one heuristic found: a subset of parameters for every n."""

    heuristic: str
    subsets: tuple[IntArray, ...]
    """Column indices of each subset, in the order in which they were taken; (n,) each."""
    torque_error: FloatArray
    """Weighted Euclidean error on the estimation set of each subset, (m,)."""
    torque_error_1: FloatArray
    """The same in the 1-norm, (m,)."""
    torque_error_inf: FloatArray
    """The same in the infinity norm, (m,)."""
    parameters: tuple[FloatArray, ...]
    """Approximate base parameters of each subset, in its order; (n,) each."""
    beta: tuple[FloatArray, ...]
    """W_E ~ W_R beta, the other columns in ascending order; (n, n_all - n) each."""
    minimum_norm: BoolArray
    """Where the subset is beyond the rank and the fit is the minimum-norm one, (m,)."""
    seconds: float

    def subset(self, n: int) -> IntArray:
        """The columns of the subset of size n, (n,)."""
        row = self.row(n)
        if row is None:
            raise KeyError(n)
        return self.subsets[row]

    @property
    def order(self) -> IntArray | None:
        """Column indices, the first n of which are the subset of size n; None if not nested."""
        longest = self.subsets[-1]
        nested = all(np.array_equal(s, longest[: s.size]) for s in self.subsets)
        return longest if nested else None


@dataclass(frozen=True)
class Proofs(BySize):
    """How far the best subset of at most each size is proven; arrays have one row per size."""

    units: tuple[IntArray, ...]
    """Columns that were chosen as one, the most wanted first."""
    subsets: tuple[IntArray, ...]
    """Column indices of the best subset found of at most each size."""
    torque_error: FloatArray
    """Of these, (m,)."""
    lower_bound: FloatArray
    """Torque error that no subset of the size is below, (m,)."""
    status: tuple[str, ...]
    """`optimal`, `best-found`, or `uncertified` where double precision is not enough."""
    seconds: FloatArray
    """Time spent on each size in all runs, (m,)."""
    nodes: IntArray
    """Nodes of the search tree that were visited, (m,)."""
    logs: tuple[IntArray, ...]
    """Where each unfinished search stopped, to go on from there."""


@dataclass(frozen=True)
class Reduction:
    """The subsets of all heuristics on one estimation set."""

    names: tuple[str, ...]
    """Of the columns: the standard parameters, a tied group being one column."""
    expansion: FloatArray
    """Standard parameters from values of the columns, (n_standard, n)."""
    nominal_torque: FloatArray
    rank: int
    factor: FloatArray
    """Triangular factor of the weighted [W | chi] of the estimation set, (n + 1, n + 1)."""
    heuristics: Mapping[str, Subsets]
    """By name, `HEURISTIC@CRITERION` where the criterion is not the torque error."""
    proofs: Proofs | None
    """Of the best subsets by torque, where they were looked for."""

    @property
    def unfinished(self) -> bool:
        """Whether more time could prove more."""
        return self.proofs is not None and "best-found" in self.proofs.status

    def standard(self, subset: IntArray, values: FloatArray) -> FloatArray:
        """Standard parameters of a reduced model, zero where one is not kept, (n_standard,)."""
        result: FloatArray = self.expansion[:, subset] @ values
        return result


@dataclass(frozen=True)
class HeuristicValidation(BySize):
    """Errors and costs of one heuristic's subsets; every array has one row per subset."""

    torque_error_estimation: FloatArray
    torque_error_validation: FloatArray
    torque_error_joint_estimation: FloatArray
    """(m, n_dof)"""
    torque_error_joint_validation: FloatArray
    acceleration_error_estimation: FloatArray
    acceleration_error_validation: FloatArray
    acceleration_error_joint_estimation: FloatArray
    acceleration_error_joint_validation: FloatArray
    mass_matrix_condition: FloatArray
    """Largest over the samples."""
    mass_matrix_smallest_eigenvalue: FloatArray
    """Smallest over the samples."""
    operations_inverse: IntArray
    operations_direct: IntArray
    operations_inverse_plain: IntArray
    operations_direct_plain: IntArray
    operations_inverse_paper_rule: IntArray
    operations_direct_paper_rule: IntArray


@dataclass(frozen=True)
class Selected:
    """The model that the config asks for."""

    heuristic: str
    n: int
    parameters: tuple[str, ...]
    values: FloatArray
    expressions: tuple[str, ...]
    """Each approximate base parameter as a linear expression of standard ones."""
    reason: str
    """One sentence that says why it was taken."""
    missed: str
    """What the tolerances asked for and no model has; empty where they are kept."""


@dataclass(frozen=True)
class Stability:
    """What the selection would be on other data; arrays have one row per variant of the data."""

    variants: tuple[str, ...]
    """What each one is."""
    chosen: BoolArray
    """(n_variants, n_columns)"""
    values: FloatArray
    """Approximate base parameters, not a number where not chosen, (n_variants, n_columns)."""
    torque_error: FloatArray
    """Of each subset on its own data, (n_variants,)."""


@dataclass(frozen=True)
class Validation:
    """What the reduced models are worth, and whether the selected one is accepted."""

    heuristics: Mapping[str, HeuristicValidation]
    full: Mapping[str, int | float]
    """Operation counts and mass-matrix figures of the full model, by name."""
    nominal_acceleration: FloatArray
    selected: Selected
    pareto: tuple[tuple[str, int], ...]
    """Heuristic and n of every model that no other one beats in all respects."""
    stability: Stability | None
    """Of the selected subset, where it was asked for."""
    accepted: bool
    verdict: str
    """One sentence that says why."""
    remarks: tuple[str, ...]


@dataclass(frozen=True)
class Report:
    """The files of the report by their path below ``report/``."""

    summary: Mapping[str, Any]
    files: Mapping[str, bytes]


@dataclass(frozen=True)
class Progress:
    """One step of a long piece of work, for whoever shows it."""

    task: str
    done: float
    total: float
    remark: str = ""


@dataclass(frozen=True)
class Provenance:
    """Where an artifact came from."""

    robot: str
    config_sha256: str
    versions: Mapping[str, str]
    seconds: Mapping[str, float]


@dataclass(frozen=True)
class Run:
    """What the caller lends a stage: workers, a place for finished parts, an audience."""

    jobs: int = 1
    parts: MutableMapping[str, Trajectory] = field(default_factory=dict)
    """Finished parts of an artifact that is not whole yet, kept across interruptions."""
    progress: Callable[[Progress], None] = lambda _: None
    interrupted: Callable[[], None] = lambda: None
    """Told by a stage that it has met a KeyboardInterrupt and ends early, but whole."""
