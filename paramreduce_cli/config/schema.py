"""Schema of a robot's YAML file, with units and defaults; nothing here reads files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, ClassVar, Literal, get_args

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from paramreduce_cli.config.clearance import ClearanceSection
from paramreduce_cli.config.constraints import ConstraintSection
from paramreduce_cli.config.identification import IdentificationSection
from paramreduce_cli.config.log_settings import LogSection
from paramreduce_cli.config.term_settings import TermsSection
from paramreduce_cli.fields.names import OneMethod, OneOf
from paramreduce_cli.fields.numbers import Number, Whole
from paramreduce_cli.fields.section import (
    Count,
    CountOrNone,
    LimitPerJoint,
    Name,
    Pair,
    PairPerJoint,
    PerJoint,
    Positive,
    PositivePerJoint,
    Section,
    Seed,
    Span,
    expand_per_joint,
    split_words,
)
from paramreduce_cli.records import (
    SETS,
    Constraint,
    CountedDynamics,
    JointLimits,
    Kind,
    Mechanism,
    Parameter,
)
from paramreduce_cli.robots import Robot

Method = Annotated[str, OneMethod()]
Criterion = Annotated[str, OneOf("criterion", "excitation/criteria")]
Scaling = Annotated[str, OneOf("scaling", "excitation/scalings")]
ParameterKind = Literal["m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"]


class ModelSection(Section):
    """The settings for finding and choosing base parameters."""

    base_columns: list[str] | None = None
    """Names of the independent parameters; if left out they are taken in the order Izz Ixx Ixy Ixz Iyz mx my Iyy mz m."""
    rank_tolerance: Annotated[Number, Field(gt=0, lt=1)] = 1e-9
    """Singular values below this share of the largest one count as zero."""


class TrajectoriesSection(Section):
    """The settings for exciting trajectories."""

    count: Count = 10
    """Trajectories of the estimation set."""
    validation_count: Count = 1
    """Trajectories of the validation set."""
    test_count: CountOrNone = 10
    """Trajectories of the test set, which are optimised like the others, and which nothing before `validate` looks at."""
    test_point_to_point_count: CountOrNone = 10
    """Motions from rest to rest that the test set holds besides, between positions that its trajectories pass, or those of the validation set where it has none, as fast as the limits allow."""
    harmonics: Annotated[Whole, Field(ge=1, le=100)] = 4
    """Harmonics of the Fourier series."""
    period: Span = 2 * np.pi
    """s"""
    points: Annotated[Whole, Field(ge=4, le=10_000_000)] = 100
    """Grid points over a period on which criterion and limits are evaluated; the search finds its way on 25 for every harmonic, if these are fewer."""
    position_limits: PairPerJoint | None = None
    """[lower, upper] for all joints, or a list of one pair per joint; rad (m if prismatic). Needed where trajectories are optimised or terms are pruned."""
    velocity_limits: LimitPerJoint | None = None
    """Largest speed, one for all joints or a list; rad/s (m/s if prismatic). Needed with position_limits."""
    acceleration_limits: LimitPerJoint | None = None
    """Largest acceleration, one for all joints or a list; rad/s^2 (m/s^2 if prismatic)."""
    torque_limits: LimitPerJoint | None = None
    """Largest torque of the model with the values in the config, one for all joints or a list; N m (N if prismatic)."""
    power_limits: LimitPerJoint | None = None
    """Largest product of torque and speed, one for all joints or a list; W."""
    torque_noise: PositivePerJoint | None = None
    """Standard deviation of measured torques, which weights the rows of each joint: a joint that is measured better counts more; the nominal torques if left out; one for all joints or a list, N m (N if prismatic)."""
    rest_to_rest: bool = False
    """Whether trajectories begin and end at rest, without acceleration."""
    start_pose: PerJoint | None = None
    """Where the machine stands before and after, rad or m: exported trajectories go there and back, and motions with bounds are looked for around it."""
    clearance: ClearanceSection | None = None
    """Distances that bodies keep from each other and from planes."""
    use_full_range: bool = True
    """Whether every joint must reach one of its limits."""
    constraints: list[ConstraintSection] = []
    """Bounds on quantities of the mechanism along the trajectories, besides the limits of the independent coordinates."""
    criterion: Criterion = "condition-number"
    """Quantity that is minimised."""
    scaling: Scaling = "column-normalised"
    """Scaling of the base columns of W in which the criterion is measured."""
    starts: Count = 8
    """Starts per trajectory; where nothing but joint limits binds, each is the best of many random motions."""
    polished: Count = 2
    """Number of the most promising starts that are optimised to the end."""
    max_iterations: Count = 250
    """Largest number of IPOPT's iterations, for each level of sharpness."""
    seed: Seed = 0
    """Seed of the random starts."""
    file: Path | None = None
    """Fourier coefficients to use instead of optimising: a trajectories.h5, or a summary.json; relative to this file."""

    def build_limits(self, n_dof: int) -> JointLimits:
        """Return the limits of every joint."""
        given = self.position_limits or [[-np.inf, np.inf]]
        pairs = np.broadcast_to(np.array(given, dtype=float), (n_dof, 2))
        return JointLimits(
            lower=pairs[:, 0],
            upper=pairs[:, 1],
            velocity=expand_per_joint(self.velocity_limits or [np.inf], n_dof),
            acceleration=expand_per_joint(self.acceleration_limits or [np.inf], n_dof),
            torque=expand_per_joint(self.torque_limits or [np.inf], n_dof),
            power=expand_per_joint(self.power_limits or [np.inf], n_dof),
        )

    def build_constraints(self, mechanism: Mechanism) -> tuple[Constraint, ...]:
        """Return constraints and clearances as records."""
        given = [entry.build_constraint(mechanism) for entry in self.constraints]
        if self.clearance is not None:
            given += self.clearance.build_constraints(mechanism)
        return tuple(given)


class InputSection(Section):
    """A force on an independent coordinate in a simulation: sines of time with random phases, and feedback."""

    amplitude: Annotated[Number, Field(ge=0)] = 0.0
    """Amplitude of each sine, N m (N if prismatic)."""
    frequencies: list[Positive] = []
    """Frequencies of the sines, Hz."""
    stiffness: Annotated[Number, Field(ge=0)] = 0.0
    """Feedback of the coordinate, N m/rad (N/m)."""
    damping: Annotated[Number, Field(ge=0)] = 0.0
    """Feedback of its speed, N m s/rad (N s/m)."""
    reference: Number = 0.0
    """Position that the feedback leads to, rad (m)."""

    @model_validator(mode="after")
    def _check_amplitude(self) -> InputSection:
        """Raise ValueError unless amplitude and frequencies are given together."""
        if bool(self.amplitude) != bool(self.frequencies):
            raise ValueError("amplitude and frequencies belong together; one of them does nothing")
        return self


ROAD_PROFILE = "road profile"
"""Name of a road's profile among files of signals, which no coordinate can have."""


class MotionSection(Section):
    """A motion that an independent coordinate is forced to follow in a simulation: sines of time with random phases, or values of a file."""

    amplitude: Annotated[Number, Field(ge=0)] = 0.0
    """Amplitude of each sine, rad (m if prismatic)."""
    frequencies: list[Positive] = []
    """Frequencies of the sines, Hz."""
    file: Path | None = None
    """Table of times, s, and positions, rad (m if prismatic), with a heading for each column; relative to this file."""

    @model_validator(mode="after")
    def _check_motion(self) -> MotionSection:
        """Raise ValueError unless either sines or a file are given."""
        if bool(self.amplitude) != bool(self.frequencies):
            raise ValueError("amplitude and frequencies belong together; one of them does nothing")
        if self.frequencies and self.file is not None:
            raise ValueError("give frequencies or a file, not both")
        if not self.model_fields_set:
            raise ValueError(
                "is empty; give amplitude and frequencies, or a file, or amplitude: 0 to hold it"
            )
        return self


class RoadSection(Section):
    """A road under the wheels of a vehicle at constant speed, which prescribes the heights of massless bodies."""

    tracks: Annotated[
        list[Annotated[list[Name], Field(min_length=1)]], Field(min_length=1, max_length=2)
    ]
    """One or two tracks: the coordinates of heights under the wheels, from front to rear."""
    distances: Annotated[list[Number], Field(min_length=1)]
    """Distances of the wheels of a track behind the first wheel, m: 0, then the wheelbase."""
    speed: Positive
    """Speed of the vehicle, m/s."""
    width: Positive | None = None
    """Distance between the two tracks, m, on which their likeness depends; needed for two tracks without a file."""
    roughness: Literal["A", "B", "C", "D", "E"] | Positive = "C"
    """Class of ISO 8608, or spectral density at 0.1 cycles per metre, m^3: a random road for every motion."""
    file: Path | None = None
    """Profile instead of a random road: a table of distances and heights, m, one height for each track, with a heading for each column; relative to this file."""

    @model_validator(mode="after")
    def _check_tracks(self) -> RoadSection:
        """Raise ValueError if tracks and distances do not fit each other."""
        if any(len(track) != len(self.distances) for track in self.tracks):
            raise ValueError(
                f"each track needs {len(self.distances)} wheels, as many as there are distances"
            )
        if any(distance < 0 for distance in self.distances):
            raise ValueError("distances are behind the first wheel, and so not negative")
        if len(self.tracks) == 2 and self.width is None and self.file is None:
            raise ValueError("two tracks need width, the distance between them")
        return self


class SimulationSection(Section):
    """The settings for samples of simulated motions under inputs, for mechanisms that cannot follow every trajectory.

    Coordinates without an input have no torque. Those with a prescribed motion have the torque that it takes; their
    accelerations are no result, and acceleration errors leave them out.
    """

    inputs: dict[str, InputSection] = {}
    """Forces by the name of the independent coordinate."""
    motions: dict[str, MotionSection] = {}
    """Prescribed motions by the name of the independent coordinate."""
    road: RoadSection | None = None
    """Road that prescribes heights under wheels."""
    duration: Span = 10.0
    """Duration of each motion, s."""
    step: Positive = 0.01
    """Step between samples, s."""
    runs: Count = 4
    """Motions of the estimation set."""
    validation_runs: Count = 1
    """Motions of the validation set."""
    test_runs: CountOrNone = 10
    """Motions of the test set."""
    start: dict[str, Pair] = {}
    """[lower, upper] of independent coordinates at the start, rad (m); where the mechanism is assembled, or zero, if left out."""
    speed: dict[str, Number] = {}
    """Velocities of independent coordinates at the start, rad/s (m/s); zero if left out."""
    equilibrium: bool = False
    """Whether motions begin in the static equilibrium that is nearest to the start."""

    @property
    def prescribed(self) -> list[str]:
        """Names of the coordinates that follow a motion."""
        wheels = [] if self.road is None else [name for track in self.road.tracks for name in track]
        return [*self.motions, *wheels]

    def list_files(self) -> dict[str, Path]:
        """Return the files of signals by the coordinate that they move; a road's under :data:`ROAD_PROFILE`."""
        files = {name: motion.file for name, motion in self.motions.items()}
        files |= {ROAD_PROFILE: None if self.road is None else self.road.file}
        return {name: path for name, path in files.items() if path is not None}


class SamplingSection(Section):
    """The estimation, validation and test sets."""

    points: Annotated[Whole, Field(ge=2, le=10_000_000)] | None = None
    """Samples per estimation trajectory; as many as trajectories.points if left out."""
    validation_points: Annotated[Whole, Field(ge=2, le=10_000_000)] | None = None
    """Samples per validation trajectory; as many as trajectories.points if left out."""
    estimation_file: Path | None = None
    """Recorded states (CSV or HDF5) instead of the estimation trajectories; relative to this file."""
    validation_file: Path | None = None
    """Recorded states (CSV or HDF5) instead of the validation trajectories; relative to this file."""
    test_file: Path | None = None
    """Recorded states (CSV or HDF5) instead of the trajectories of the test set; relative to this file."""
    simulation: SimulationSection | None = None
    """Simulated motions instead of trajectories, for all sets."""
    log: LogSection | None = None
    """Logs of the machine instead of trajectories, for both sets."""
    torques: Literal["measured", "model"] = "measured"
    """Torques of recorded states: measured ones, which the files must hold, or those of the model."""
    symmetries: list[Annotated[list[str], Field(min_length=1)]] = []
    """Symmetries of the mechanism that complete the estimation set: each lists, for every independent coordinate in turn, the one that moves in its place, `-NAME` where it moves the other way."""
    nominal_acceleration: PositivePerJoint | Literal["standard-deviation"] = "standard-deviation"
    """Characteristic accelerations, one for all joints or a list, rad/s^2 (m/s^2 if prismatic); or their standard deviation over the estimation set."""

    def list_recordings(self) -> dict[str, Path | None]:
        """Return the files of recorded states by set; None where there is none."""
        return {name: getattr(self, f"{name}_file") for name in SETS}

    @property
    def recorded(self) -> bool:
        """Whether the estimation and the validation set are recordings."""
        return self.estimation_file is not None and self.validation_file is not None

    @property
    def needs_trajectories(self) -> bool:
        """Whether states come from trajectories, and not from logs, a simulation or recordings of both sets."""
        return self.log is None and self.simulation is None and not self.recorded

    @property
    def measured(self) -> bool:
        """Whether torques of the estimation set are those of a machine."""
        recorded = self.estimation_file is not None and self.torques == "measured"
        return self.log is not None or recorded


class GroupSection(Section):
    """A rule that groups parameters of the same role on several bodies: they are selected or dropped together."""

    name: Name
    """Name of the group; with bodies the groups are called KIND_NAME."""
    bodies: Annotated[list[Name], Field(min_length=2)] | None = None
    """Bodies that play the same role: each kind of parameter makes a group of its own."""
    kinds: Annotated[list[ParameterKind], Field(min_length=1)] = [*get_args(ParameterKind)]
    """Kinds of parameters of these bodies that are grouped."""
    parameters: Annotated[list[str], Field(min_length=2)] | None = None
    """Names of the parameters of one group, instead of bodies."""
    tied: bool = False
    """Whether they share one value, which then counts as one parameter; otherwise each has its own."""

    @model_validator(mode="after")
    def _check_members(self) -> GroupSection:
        """Raise ValueError unless either bodies or parameters are given."""
        if (self.bodies is None) == (self.parameters is None):
            raise ValueError("give bodies or parameters, one of them")
        return self

    def list_groups(self) -> dict[str, list[str]]:
        """Return the names of the parameters of every group, by the group's name."""
        if self.parameters is not None:
            return {self.name: list(self.parameters)}
        return {
            Parameter(kind, self.name).name: [
                Parameter(kind, body).name for body in self.bodies or []
            ]
            for kind in map(Kind.parse, self.kinds)
        }


class Stop(Section):
    """The size or error at which a heuristic stops; without both it orders all parameters."""

    torque_error: Positive | None = None
    """Smallest subset whose torque error is at most this, a share."""
    parameters: Count | None = None
    """Number of parameters."""


class BestSubset(Section):
    """The search for proven subsets."""

    time_limit: Annotated[Number, Field(ge=0)] = 60.0
    """Time limit for all sizes together, s; what is not proven then is reported with a lower bound, and the next run goes on."""
    node_limit: Count | None = None
    """Nodes of the search tree for each size: ends at the same place on every machine, but where jobs share subtrees."""
    parts: Literal["sizes", "subtrees"] = "sizes"
    """What `--part` deals among jobs: sizes, or the subtrees of every size, where few of them are hard."""


class OperationsCriterion(Section):
    """The criterion `operations`."""

    torque_error: Positive = 0.01
    """Torque error on the estimation set up to which operations are minimised, a share; higher ones are penalised."""


class ReductionSection(Section):
    """The settings for selecting parameters."""

    heuristics: Annotated[list[Method], Field(min_length=1)] = [
        "qr",
        "forward-selection",
        "forward-selection-2",
        "floating",
        "backward-elimination",
        "swap",
        "best-subset",
    ]
    """Which heuristics run; HEURISTIC@CRITERION selects by acceleration or operations instead of torque."""
    best_subset: BestSubset = BestSubset()
    """Search for proven subsets."""
    operations: OperationsCriterion = OperationsCriterion()
    """Selection by the cost of evaluating the model."""
    weighting: Literal["nominal-torque", "noise", "none"] = "nominal-torque"
    """What each joint's torques are divided by in fitting and scoring alike: nominal torques, the noise that a fit of all parameters leaves (for measured torques), or nothing."""
    groups: list[GroupSection] | Literal["auto"] = []
    """Parameters that are selected or dropped together; auto groups those of the same role in all uses of a subsystem."""
    stop: Stop = Stop()
    """When to stop."""


class SelectedSection(Section):
    """The reduced model that validate judges and report shows: by its size, or the smallest that keeps to tolerances on both sets."""

    USUAL: ClassVar[Mapping[str, float]] = {"torque_error": 0.01}
    """Tolerances where none are given."""
    SIMULATED: ClassVar[Mapping[str, float]] = {"acceleration_error": 0.05}
    """Tolerances that models for simulation have besides."""

    heuristic: Method | None = None
    """Whose subset; of all heuristics the best one if left out."""
    n: Count | None = None
    """Number of parameters."""
    torque_error: Positive | None = None
    """Largest torque error, a share; 0.01 if nothing is given."""
    acceleration_error: Positive | None = None
    """Largest acceleration error, a share."""
    operations: Positive | None = None
    """Most operations of the inverse dynamics."""
    cross_validation: bool | Literal["parsimonious"] = False
    """Whether the size is chosen by leaving out one part of the estimation set at a time; the validation set is not looked at. `true` selects the smallest model that is at most 3 % worse than the best one and than all parameters, at the upper end of a 90 % interval; `parsimonious` the smallest one within one standard error of the best."""
    use: Literal["feed-forward", "simulation"] | None = None
    """Purpose of the model. For simulation its mass matrix is positive definite on all samples, and it keeps acceleration_error, 0.05 if that is not given; if left out simulation where samples come from one, otherwise feed-forward."""

    @model_validator(mode="after")
    def _check_one_rule(self) -> SelectedSection:
        """Raise ValueError if several rules for the number of parameters are given."""
        if self.cross_validation and (self.n is not None or self.get_tolerances()):
            raise ValueError("cross_validation chooses n itself; leave out n and tolerances")
        if self.n is not None and self.get_tolerances():
            raise ValueError(f"give n or {', '.join(self.get_tolerances())}, not both")
        return self

    def get_tolerances(self) -> dict[str, float]:
        """Return the given tolerances by key."""
        keys = ("torque_error", "acceleration_error", "operations")
        return {key: value for key in keys if (value := getattr(self, key)) is not None}

    def list_tolerances(self) -> dict[str, float]:
        """Return the tolerances that hold, given or not, by key."""
        given = self.get_tolerances() or dict(self.USUAL)
        return {**self.SIMULATED, **given} if self.use == "simulation" else given


class Acceptance(Section):
    """The largest values at which the selected model is accepted; missing limits are not checked."""

    torque_error_estimation: Positive | None = None
    """Torque error on the estimation set, a fraction (0.01 is 1 %)."""
    torque_error_validation: Positive | None = None
    """Torque error on the validation set, a fraction."""
    torque_error_test: Positive | None = None
    """Torque error on the test set: median over its motions, a fraction."""
    torque_error_test_worst: Positive | None = None
    """Torque error on the worst motion of the test set, a fraction."""
    acceleration_error_estimation: Positive | None = None
    """Acceleration error on the estimation set, a fraction."""
    acceleration_error_validation: Positive | None = None
    """Acceleration error on the validation set, a fraction."""
    acceleration_error_test: Positive | None = None
    """Acceleration error on the test set: median over its motions, a fraction."""
    acceleration_error_test_worst: Positive | None = None
    """Acceleration error on the worst motion of the test set, a fraction."""
    operations_inverse: Positive | None = None
    """Operations of the inverse dynamics."""
    operations_direct: Positive | None = None
    """Operations of mass matrix and bias."""


class ValidationSection(Section):
    """The settings for accepting the selected model, and for measuring its stability."""

    accept: Acceptance = Acceptance()
    """Limits that turn into the exit code: 0 accepted, 1 not accepted."""
    operations: CountedDynamics = CountedDynamics.GENERALISED
    """Functions of closed loops to count: d_q and [M_qq | delta_q] of the open tree, or d_z and [M_zz | delta_z] with R and b as inputs."""
    stability: bool = True
    """Whether the selection is repeated with each trajectory left out and with fewer samples."""


class TrackingSection(Section):
    """The settings for computed-torque control with the full and with the selected model, in simulation."""

    bandwidth: Positive = 20.0
    """Bandwidth of the feedback, critically damped, rad/s."""
    moves: Annotated[int, Field(ge=1, le=20)] = 4
    """Number of moves from rest to rest."""


class ReportSection(Section):
    """The settings of the report."""

    title: str | None = None
    """Heading; the robot's name if left out."""
    formats: Annotated[
        list[Literal["pdf", "svg", "png"]],
        BeforeValidator(
            split_words, json_schema_input_type=list[Literal["pdf", "svg", "png"]] | str
        ),
        Field(min_length=1),
    ] = ["svg"]
    """File formats of the figures: pdf, svg, png, or a list of these. PDF figures have the width of a paper's column."""
    tracking: TrackingSection | None = None
    """Whether control with the exported models is demonstrated, for open trees."""
    poses: Annotated[list[PerJoint], Field(min_length=1)] | None = None
    """Coordinates of the poses in which the mechanism is drawn, rad or m; three of the validation set if left out."""


CLOSED = r"^[^=:]+=[^=:]+(:(fixed|revolute|spherical))?$"


class SourceSection(Section):
    """The robot file that a config was made from, and what was asked of it; so that it can be written back."""

    file: Path
    """The file; relative to this one."""
    root: str | None = None
    """The link that stands still; the file's own root if left out."""
    tip: str | None = None
    """The last link of a chain; joints beside it are locked."""
    locked: dict[str, Number] = {}
    """Coordinates of joints that do not move, rad or m."""
    ignored: list[str] = []
    """Links that are left out, with all that they carry."""
    floating: bool = False
    """Whether the root moves freely."""
    uncoupled: bool = False
    """Whether joints that follow others in the file move on their own."""
    closed: list[Annotated[str, Field(pattern=CLOSED)]] = []
    """Pairs of links whose frames are held together, `A=B` for all of their motion, `A=B:revolute` but for a turn about z, `A=B:spherical` but for any turn."""
    independent: list[str] = []
    """Joints that are driven and determine all others where links are held together; chosen if left out."""


class Settings(Section):
    """The settings for samples without any robot."""

    reduction: ReductionSection = ReductionSection()
    """Selection of parameters."""
    selected: SelectedSection = SelectedSection()
    """The model to judge."""
    validation: ValidationSection = ValidationSection()
    """Judgement."""
    report: ReportSection = ReportSection()
    """Figures and tables."""


class Config(Robot):
    """A robot and everything that is done with it."""

    source: SourceSection | None = None
    """The robot file it was made from."""
    model: ModelSection = ModelSection()
    """Base parameters."""
    trajectories: TrajectoriesSection = TrajectoriesSection()
    """Exciting trajectories."""
    sampling: SamplingSection = SamplingSection()
    """Estimation and validation sets."""
    reduction: ReductionSection = ReductionSection()
    """Selection of parameters."""
    selected: SelectedSection = SelectedSection()
    """The model to judge."""
    validation: ValidationSection = ValidationSection()
    """Judgement."""
    identification: IdentificationSection = IdentificationSection()
    """Values from measured torques."""
    terms: TermsSection | None = None
    """Functions whose terms are reduced too."""
    report: ReportSection = ReportSection()
    """Report."""
