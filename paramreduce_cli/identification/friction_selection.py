"""The shape of friction, chosen within the training part.

Friction is linear in its parameters but for a few shape parameters: the speed at which Coulomb friction is smoothed, and
the speed beyond which Stribeck friction fades. Given these, all parameters follow from linear least squares (separable
least squares [Golub2003]). Load-dependent friction comes last, because its load is the gravity torque of the parameters that were fitted before; for it the
columns are computed again.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from paramreduce_cli.identification.band_scoring import (
    Band,
    ComputeColumns,
    compute_rows,
    factorise_band,
    make_column_function,
)
from paramreduce_cli.identification.data_split import Piece
from paramreduce_cli.identification.friction_shapes import (
    Candidate,
    SelectedShapes,
    ShapeSearch,
    list_candidates,
)
from paramreduce_cli.identification.state_estimation import (
    PER_STATE_CUTOFF,
    Cutoffs,
    choose_decimation,
    compute_edge,
    estimate_states,
)
from paramreduce_cli.multibody.drive_dynamics import OddFunctions, express_unit_force
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.records import (
    INERTIAL,
    BoolArray,
    CutoffSearch,
    Drive,
    FloatArray,
    FrictionSearch,
    IntArray,
    Kind,
)

_NUMPY = OddFunctions(np.sign, np.tanh)
_FRICTION = (Kind.COULOMB, Kind.STRIBECK, Kind.ASYMMETRY, Kind.QUADRATIC, Kind.LOAD)
_PER_BAND = 6
"""Highest frequency of the torques before the low-pass, over that of the scored band."""


@dataclass(frozen=True)
class FrictionModel:
    """The drives whose friction a log decides, and all other columns.

    Attributes:
        drives: The drives.
        fixed: Whether the config gives the smoothing of each drive.
        independent: Indices of the independent coordinates among the generalised ones, (n_dof,).
        kept: The other base parameters' columns.
        inertial: Whether these are of bodies and payloads.
        n_inertial: Number of parameters of bodies and payloads; they come first.
        compute_columns: Function that returns the other base parameters' columns.
        closed: Whether the mechanism has loops.
    """

    drives: tuple[Drive, ...]
    fixed: tuple[bool, ...]
    independent: tuple[int, ...]
    kept: IntArray
    inertial: BoolArray
    n_inertial: int
    compute_columns: ComputeColumns
    closed: bool

    def compute_gravity(self, z: FloatArray, parameters: FloatArray) -> FloatArray:
        """Return the torques of gravity, (n_samples, n_dof), for some values of the other base parameters."""
        rest = np.zeros_like(z)
        W = self.compute_columns(z, rest, rest)
        return W[:, :, self.inertial] @ parameters[self.inertial]


def make_friction_model(
    dynamics: Dynamics, base: IntArray, names: Iterable[str], fixed: Iterable[str]
) -> FrictionModel:
    """Return the friction model of a robot.

    Args:
        dynamics: Dynamics of the robot.
        base: Columns of the base parameters.
        names: Names of the drives whose friction the log decides.
        fixed: Names of the drives whose smoothing the config gives.
    """
    mechanism = dynamics.mechanism
    chosen, given = set(names), set(fixed)
    # Drives along dependent coordinates keep the smoothing that they have.
    dependent = list(mechanism.dependent)
    drives = tuple(
        drive
        for drive in mechanism.drives
        if drive.name in chosen and not np.any(drive.weights[dependent])
    )
    chosen = {drive.name for drive in drives}
    kept = np.array(
        [
            k
            for k in base.tolist()
            if mechanism.parameters[k].kind not in _FRICTION
            or mechanism.parameters[k].owner not in chosen
        ],
        dtype=np.int64,
    )
    inertial = np.array([parameter.kind in INERTIAL for parameter in mechanism.parameters])
    return FrictionModel(
        drives,
        tuple(drive.name in given for drive in drives),
        tuple(mechanism.independent),
        kept,
        inertial[kept],
        int(inertial.sum()),
        make_column_function(dynamics, kept),
        mechanism.loops is not None,
    )


def select_friction(
    pieces: Sequence[Piece],
    rate: float,
    cutoffs: CutoffSearch,
    model: FrictionModel,
    measured: BoolArray,
    n_folds: int,
) -> FrictionSearch | None:
    """Choose the smoothing of each drive's friction, and the terms that lower the error on left-out folds.

    Args:
        pieces: Training pieces as recorded.
        rate: Recorded samples per second.
        cutoffs: Cut-off frequencies, and the band of torques that is scored.
        model: Drives whose friction is to be chosen.
        measured: Joints whose torques are measured, (n_dof,).
        n_folds: Number of folds.

    Returns:
        The choice, or None if there are no drives, or if the log is too short.
    """
    if not model.drives:
        return None
    fastest = _find_largest_speeds(pieces, rate, cutoffs.state, model)
    candidates = [
        list_candidates(drive, speed) for drive, speed in zip(model.drives, fastest, strict=True)
    ]

    def select(
        candidates: Sequence[Sequence[Candidate]], parameters: FloatArray | None = None
    ) -> ShapeSearch | None:
        """Return the search among the candidates, or None if the log is too short; the parameters give the load."""
        band = _compute_band(pieces, rate, cutoffs, model, candidates, parameters, n_folds)
        return None if band is None else ShapeSearch(band, candidates, model.fixed, measured)

    search = select(candidates)
    if search is None:
        return None
    first = found = search.choose_shape()
    loads = [(*own, Candidate(Kind.LOAD, own[0].speed)) for own in first.columns]
    search = None if model.closed else select(loads, first.parameters)
    if search is not None:
        found = search.extend(first.columns)
    bodies = np.zeros(model.n_inertial)
    bodies[model.kept[model.inertial]] = first.parameters[model.inertial]
    return _make_record(model.drives, found, bodies, first.usual_error)


def _make_record(
    drives: Sequence[Drive], selected: SelectedShapes, bodies: FloatArray, usual: float
) -> FrictionSearch:
    """Return the choice as a record."""
    kinds = [{term.kind for term in own[1:]} for own in selected.columns]
    fading = [
        [term.speed for term in own[1:] if term.kind is Kind.COULOMB] for own in selected.columns
    ]
    return FrictionSearch(
        drives=tuple(drive.name for drive in drives),
        smoothing=np.array([own[0].speed for own in selected.columns]),
        stribeck_velocity=np.array([own[0] if own else np.nan for own in fading]),
        asymmetry=np.array([Kind.ASYMMETRY in own for own in kinds]),
        quadratic=np.array([Kind.QUADRATIC in own for own in kinds]),
        load=np.array([Kind.LOAD in own for own in kinds]),
        bodies=bodies,
        error=selected.error,
        usual_error=usual,
    )


def _compute_band(
    pieces: Sequence[Piece],
    rate: float,
    cutoffs: CutoffSearch,
    model: FrictionModel,
    candidates: Sequence[Sequence[Candidate]],
    parameters: FloatArray | None,
    n_folds: int,
) -> Band | None:
    """Return the factors of the columns without friction, then of all candidates drive by drive, below the scored frequency.

    Args:
        pieces: Training pieces as recorded.
        rate: Recorded samples per second.
        cutoffs: Cut-off frequencies, and the band of torques that is scored.
        model: The drives.
        candidates: Columns of each drive.
        parameters: Parameters of the columns without friction, which give the load, (n_rest,); None without load.
        n_folds: Number of folds.
    """

    def compute_columns(z: FloatArray, dz: FloatArray, ddz: FloatArray) -> FloatArray:
        """Return all columns, (n_samples, n_dof, n)."""
        gravity = np.zeros_like(z) if parameters is None else model.compute_gravity(z, parameters)
        friction = [
            _compute_friction(drive, own, dz, gravity, model.independent)
            for drive, own in zip(model.drives, candidates, strict=True)
        ]
        return np.concatenate([model.compute_columns(z, dz, ddz), *friction], axis=2)

    edges = np.array([compute_edge(piece, rate, cutoffs.state) for piece in pieces])
    highest = _PER_BAND * cutoffs.scored
    rows = compute_rows(pieces, rate, cutoffs.state, highest, compute_columns, edges, n_folds)
    return None if rows is None else factorise_band(rows, cutoffs.scored, n_folds)


def _find_largest_speeds(
    pieces: Sequence[Piece], rate: float, state: float, model: FrictionModel
) -> FloatArray:
    """Return the speed that each drive exceeds in one of a hundred samples, rad/s or m/s, (n_drives,).

    Args:
        pieces: Training pieces as recorded.
        rate: Recorded samples per second.
        state: State cut-off, Hz.
        model: The drives.
    """
    cutoffs = Cutoffs(state, np.inf)
    decimation = choose_decimation(cutoffs, rate, min(rate, PER_STATE_CUTOFF * state))
    smooth = [estimate_states(piece, rate, cutoffs, decimation).signals for piece in pieces]
    speeds = np.concatenate([np.asarray(signals.dz) for signals in smooth])
    weights = np.array([drive.weights[list(model.independent)] for drive in model.drives])
    result: FloatArray = np.quantile(np.abs(speeds @ weights.T), 0.99, axis=0)
    return np.maximum(result, 1e-9)


def _compute_friction(
    drive: Drive,
    candidates: Sequence[Candidate],
    dz: FloatArray,
    gravity: FloatArray,
    independent: tuple[int, ...],
) -> FloatArray:
    """Return the torques of unit values of a drive's candidates, (n_samples, n_dof, n_candidates).

    Args:
        drive: The drive.
        candidates: Its candidates.
        dz: Speeds, (n_samples, n_dof).
        gravity: Torques of gravity, (n_samples, n_dof).
        independent: Indices of the independent coordinates among the generalised ones, (n_dof,).
    """
    rest = np.zeros(len(dz))
    speeds, loads = [rest] * drive.weights.size, [rest] * drive.weights.size
    for j, k in enumerate(independent):
        speeds[k], loads[k] = dz[:, j], gravity[:, j]
    states: tuple[list[FloatArray], ...] = ([], speeds, [], loads)
    columns = [
        express_unit_force(c.kind, replace(drive, smoothing=c.speed), states, _NUMPY)
        for c in candidates
    ]
    return np.stack(columns, axis=1)[:, None, :] * drive.weights[list(independent)][:, None]
