"""Trajectories, with the limits and constraints that they keep."""

from collections.abc import Mapping
from typing import ClassVar, Literal

from paramreduce_cli.records.arrays import FloatArray
from paramreduce_cli.records.representation import record

DISTANCES = frozenset({"distance", "distance-from-axis"})
"""Kinds of constraints that are distances."""


@record
class Constraint:
    """A bound on a quantity of the mechanism along a trajectory.

    What ``bodies`` and ``vectors`` mean depends on the kind:

    * ``coordinate``: the body whose coordinate is bounded, rad or m;
    * ``angle``: two bodies and a direction in the frame of each, rad;
    * ``distance``: two bodies and a point in the frame of each, m;
    * ``distance-from-axis``: a body and the body that carries the axis; a point in the frame of
      the first, a point and the direction of the axis in the frame of the second, m;
    * ``singularity``: none; distance to singularity of the loops, 0 to 1;
    * ``clearance``: two bodies; centres (k, 3) and radii (k,) of spheres in the frame of each, m;
    * ``above-plane``: a body and the base; centres and radii of spheres in its frame, a point and the
      normal of a plane in the base frame, (2, 3), m.
    """

    name: str
    kind: Literal[
        "coordinate", "angle", "distance", "distance-from-axis", "singularity", "clearance", "above-plane",
    ]  # fmt: skip
    bodies: tuple[int, ...]
    vectors: tuple[FloatArray, ...]
    lower: float
    """Minus infinity where there is none."""
    upper: float


@record
class JointLimits:
    """The limits of the independent coordinates, (n_dof,) each, rad or m, per s, per s^2."""

    lower: FloatArray
    upper: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    """Infinite where there is none, as in the following."""
    torque: FloatArray
    """Torque of the model, with the values in the config, N m or N."""
    power: FloatArray
    """Torque times speed, W."""

    @property
    def middle(self) -> FloatArray:
        """Middle of the position ranges, (n_dof,)."""
        return (self.upper + self.lower) / 2

    @property
    def reach(self) -> FloatArray:
        """Half the width of the position ranges, (n_dof,)."""
        return (self.upper - self.lower) / 2


@record
class Trajectory:
    """One finite Fourier series, optimised or given by the user, with its condition numbers, peaks and extremes, and
    with the time, iterations and status of the optimisation.
    """

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
    peak_torque: FloatArray
    """Peak torque of the model, with the values in the config, (n_dof,), N m or N."""
    reach: FloatArray
    """Largest share of half the position range, or of the velocity or acceleration limit, that the
    motion about its offset uses, (n_dof,)."""
    extremes: FloatArray
    """Smallest and largest value of every bounded quantity, (n_constraints, 2), in its unit."""
    cpu_seconds: float
    iterations: int
    status: str


@record
class PointToPoint:
    """A motion from rest to rest along a straight line in joint space, with the least jerk."""

    start: FloatArray
    """Independent coordinates at its beginning, (n_dof,), rad or m."""
    end: FloatArray
    """Independent coordinates at its end, (n_dof,), rad or m."""
    duration: float
    """Time from rest to rest, s."""


@record
class Trajectories:
    """The trajectories of the estimation, the validation and the test set."""

    FILE: ClassVar[str] = "trajectories.h5"
    period: float
    """s"""
    points: int
    """Number of points of the grid on which the trajectories were optimised and kept to the limits."""
    criterion: str
    scaling: str
    use_full_range: bool
    """Whether every joint had to reach one of its limits."""
    rest_to_rest: bool
    """Whether they begin and end at rest, without acceleration."""
    source: str
    """The file they were brought in; empty where they were optimised."""
    limits: JointLimits
    constraints: tuple[Constraint, ...]
    """Constraints that the trajectories keep, besides the limits of the independent coordinates."""
    estimation: tuple[Trajectory, ...]
    validation: tuple[Trajectory, ...]
    test: tuple[Trajectory, ...]
    """Motions that no search looks at, like the following."""
    test_point_to_point: tuple[PointToPoint, ...]


@record
class Coefficients:
    """The user's Fourier coefficients, (n_trajectories, n_dof, 1 + 2 harmonics) for each set."""

    source: str
    period: float
    estimation: FloatArray
    validation: FloatArray
    test: FloatArray
    """Coefficients of the test set; empty if the file holds none."""
