"""The shape of friction, chosen within the training part.

Friction is linear in its parameters but for a few shape parameters: the speed at which Coulomb friction is smoothed, and
the speed beyond which Stribeck friction fades. Given these, all parameters follow from linear least squares (separable
least squares [Golub2003]). Terms come after smoothings, because the load of load-dependent friction is the gravity torque of the
parameters that were fitted with the smoothings.
"""

from collections.abc import Collection, Iterable, Sequence
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
    list_signs,
)
from paramreduce_cli.identification.state_estimation import (
    PER_STATE_CUTOFF,
    Cutoffs,
    choose_decimation,
    compute_edge,
    estimate_states,
)
from paramreduce_cli.multibody.drive_dynamics import OddFunctions, express_unit_force
from paramreduce_cli.multibody.drive_motions import express_weighted_sum
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
        given: Terms of each drive that the config gives.
        independent: Indices of the independent coordinates among the generalised ones, (n_dof,).
        kept: The other base parameters' columns.
        inertial: Whether these are of bodies and payloads.
        n_inertial: Number of parameters of bodies and payloads; they come first.
        compute_columns: Function that returns the other base parameters' columns.
        closed: Whether the mechanism has loops.
    """

    drives: tuple[Drive, ...]
    fixed: tuple[bool, ...]
    given: tuple[tuple[Candidate, ...], ...]
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
        tuple(_list_given(drive, mechanism.find_drive_columns(drive)) for drive in drives),
        tuple(mechanism.independent),
        kept,
        inertial[kept],
        int(inertial.sum()),
        make_column_function(dynamics, kept),
        mechanism.loops is not None,
    )


def _list_given(drive: Drive, kinds: Collection[Kind]) -> tuple[Candidate, ...]:
    """Return the terms of friction that a drive has, beside Coulomb friction."""
    speeds = {Kind.STRIBECK: drive.stribeck_velocity}
    return tuple(
        Candidate(Kind.COULOMB if kind is Kind.STRIBECK else kind, speeds.get(kind, 0.0))
        for kind in _FRICTION
        if kind is not Kind.COULOMB and kind in kinds
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
    signs = [list_signs(drive, speed) for drive, speed in zip(model.drives, fastest, strict=True)]

    def select(
        candidates: Sequence[Sequence[Candidate]],
        given: Sequence[Sequence[int]],
        parameters: FloatArray | None = None,
    ) -> ShapeSearch | None:
        """Return the search among the candidates, or None if the log is too short; the parameters give the load."""
        band = _compute_band(pieces, rate, cutoffs, model, candidates, parameters, n_folds)
        return None if band is None else ShapeSearch(band, candidates, given, model.fixed, measured)

    def search(
        given: Sequence[Sequence[Candidate]],
    ) -> tuple[SelectedShapes, SelectedShapes] | None:
        """Return the smoothings that suit some terms, then those with the terms that help.

        Args:
            given: Terms of each drive while smoothings are chosen; afterwards all but those of the config are chosen anew.
        """
        without_load = [[c for c in terms if c.kind is not Kind.LOAD] for terms in given]
        pairs = list(zip(signs, without_load, strict=True))
        smoothings = select(
            [[*own, *terms] for own, terms in pairs],
            [range(len(own), len(own) + len(terms)) for own, terms in pairs],
        )
        if smoothings is None:
            return None
        first = smoothings.choose_smoothings()
        candidates = [
            [sign, *terms, *_list_terms(own, terms, closed=model.closed)]
            for (sign, *_), own, terms in zip(first.columns, signs, model.given, strict=True)
        ]
        candidates = [
            [replace(c, speed=own[0].speed) if c.kind is Kind.LOAD else c for c in own]
            for own in candidates
        ]
        terms = select(
            candidates, [range(1, 1 + len(own)) for own in model.given], first.parameters
        )
        return None if terms is None else (first, terms.choose_terms())

    found = search(model.given)
    if found is None:
        return None
    first, selected = found
    usual = first.usual_error
    if [len(own) - 1 for own in selected.columns] != [len(terms) for terms in model.given]:
        # A term that was missing may have distorted the smoothings.
        again = search([own[1:] for own in selected.columns])
        if again is not None and again[1].error < selected.error:
            first, selected = again
    bodies = np.zeros(model.n_inertial)
    bodies[model.kept[model.inertial]] = first.parameters[model.inertial]
    return _make_record(model.drives, selected, bodies, usual)


def _list_terms(
    signs: Sequence[Candidate], given: Sequence[Candidate], *, closed: bool
) -> list[Candidate]:
    """Return the terms that a drive may have besides those that the config gives."""
    kinds = {term.kind for term in given}
    usual = [Kind.ASYMMETRY, Kind.QUADRATIC, *([] if closed else [Kind.LOAD])]
    return [*signs, *(Candidate(kind) for kind in usual if kind not in kinds)]


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
    motion = express_weighted_sum(
        drive, ([rest] * drive.weights.size, speeds, [rest] * drive.weights.size)
    )
    columns = [
        express_unit_force(c.kind, replace(drive, smoothing=c.speed), motion, loads, _NUMPY)
        for c in candidates
    ]
    return np.stack(columns, axis=1)[:, None, :] * drive.weights[list(independent)][:, None]
