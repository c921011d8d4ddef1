"""Frozen records that pass between stages, and the arrays they are made of.

A record holds data and what follows from it directly; no numerics, no files.
Units are SI throughout: m, rad, s, kg, kg m, kg m^2, N, N m.
"""

from paramreduce_cli.records.arrays import BoolArray, FloatArray, IntArray
from paramreduce_cli.records.artifacts import Artifacts
from paramreduce_cli.records.items import WHOLE, Items, Part, PartFinished
from paramreduce_cli.records.logs import (
    Consistency,
    CutoffSearch,
    Estimate,
    FrictionSearch,
    Identification,
    MeasuredLog,
    MeasuredMotions,
    RawLog,
    RawLogs,
    Residuals,
    ShownSignals,
    Spectra,
)
from paramreduce_cli.records.mechanism import (
    BASE,
    JOINT_AXES,
    JOINT_COORDINATES,
    Body,
    Closure,
    ClosureKind,
    Drive,
    Length,
    Loops,
    Mechanism,
    MotionBetween,
    MotionKind,
    Payload,
    Rigid,
)
from paramreduce_cli.records.model import (
    BaseParameters,
    CountedDynamics,
    Formulation,
    Formulations,
    Model,
)
from paramreduce_cli.records.model_errors import (
    NO_MOTIONS,
    ErrorRange,
    JointErrors,
    MassMatrices,
    ModelErrors,
    Operations,
    SetErrors,
)
from paramreduce_cli.records.parameters import (
    DRIVE,
    INERTIAL,
    LAST,
    SIGN_FRICTION,
    Kind,
    Parameter,
    order_by_preference,
)
from paramreduce_cli.records.reduction import (
    NOT_KEPT,
    PROVING,
    BySize,
    Columns,
    ModelChoice,
    ProofItem,
    Proofs,
    ProofStatus,
    ReducedModel,
    Reduction,
    SelectionMethod,
    Subsets,
)
from paramreduce_cli.records.run import Progress, ProgressCallback, Provenance, Report, Run, Stored
from paramreduce_cli.records.samples import (
    SETS,
    Block,
    Recording,
    Recordings,
    Samples,
    SampleSet,
    SignalTable,
    SignalTables,
)
from paramreduce_cli.records.simulated_manoeuvre import SimulatedManoeuvre
from paramreduce_cli.records.terms import (
    NO_OPERAND,
    TERMS,
    StoredProgram,
    TermFront,
    TermModel,
    TermReduction,
)
from paramreduce_cli.records.tracking import LoopEvaluation, Paths, Speed, Tracking
from paramreduce_cli.records.trajectories import (
    DISTANCES,
    Coefficients,
    Constraint,
    JointLimits,
    PointToPoint,
    Trajectories,
    Trajectory,
)
from paramreduce_cli.records.validation import (
    About,
    CrossValidation,
    DataChange,
    DataVariant,
    HeuristicValidation,
    Leanest,
    ModelWarning,
    Selected,
    Stability,
    Validation,
)

STORED: tuple[type[Stored], ...] = tuple(
    record
    for record in list(globals().values())
    if isinstance(record, type) and "FILE" in vars(record)
)
"""Records that have a file of their own, which they name as ``FILE``."""
