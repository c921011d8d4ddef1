"""The shape of friction, chosen by cross-validation within the training part.

Friction is linear in its parameters but for a few shape parameters: the speed at which Coulomb friction is smoothed, and
the speed beyond which Stribeck friction fades. Given these, all parameters follow from linear least squares (separable
least squares [Golub2003]). The columns of all candidate shapes are computed once, so that each candidate costs one small
fit.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # its linalg is loaded when it is used

from paramreduce_cli.identification.band_scoring import (
    Band,
    ComputeColumns,
    compute_rows,
    factorise_band,
    make_column_function,
)
from paramreduce_cli.identification.data_split import Piece
from paramreduce_cli.identification.state_estimation import compute_edge
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.noise import estimate_joint_noise
from paramreduce_cli.records import (
    BoolArray,
    CutoffSearch,
    Drive,
    FloatArray,
    FrictionSearch,
    IntArray,
    Kind,
)

_SMOOTHINGS = (0.0, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32)
"""Speeds of smoothing that are tried, a share of the largest speed of the drive."""
_FRICTION = (Kind.COULOMB, Kind.STRIBECK, Kind.ASYMMETRY, Kind.QUADRATIC)
_GAIN = 0.005
"""Relative decrease of the error for which a joint gets another smoothing than the others."""
_TERM_GAIN = 0.01
"""Relative decrease of the error for which a term is added."""
_SWEEPS = 2
_RIDGE = 1e-10
"""Added to normal equations with unit diagonal, so that dependent columns do no harm."""
_PER_BAND = 6
"""Highest frequency of the torques before the low-pass, over that of the scored band."""


@dataclass(frozen=True)
class FrictionModel:
    """The drives whose friction a log decides, and all other columns.

    Attributes:
        drives: The drives.
        fixed: Whether the config gives the smoothing of each drive.
        independent: Indices of the independent coordinates among the generalised ones, (n_dof,).
        compute_columns: Function that returns the other base parameters' columns.
    """

    drives: tuple[Drive, ...]
    fixed: tuple[bool, ...]
    independent: tuple[int, ...]
    compute_columns: ComputeColumns


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
    kept = [
        k
        for k in base.tolist()
        if mechanism.parameters[k].kind not in _FRICTION
        or mechanism.parameters[k].owner not in chosen
    ]
    columns = make_column_function(dynamics, np.array(kept, dtype=np.int64))
    return FrictionModel(
        drives,
        tuple(drive.name in given for drive in drives),
        tuple(mechanism.independent),
        columns,
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
        The choice, or None if the log is too short for one.
    """
    edges = np.array([compute_edge(piece, rate, cutoffs.state) for piece in pieces])
    fastest = _find_largest_speeds(pieces, rate, model)
    candidates = [
        _list_candidates(drive, speed) for drive, speed in zip(model.drives, fastest, strict=True)
    ]

    def compute_columns(z: FloatArray, dz: FloatArray, ddz: FloatArray) -> FloatArray:
        """Return the columns without friction, then those of all candidates drive by drive."""
        friction = [
            _compute_friction(drive, own, dz, model.independent)
            for drive, own in zip(model.drives, candidates, strict=True)
        ]
        return np.concatenate([model.compute_columns(z, dz, ddz), *friction], axis=2)

    highest = _PER_BAND * cutoffs.scored
    rows = compute_rows(pieces, rate, cutoffs.state, highest, compute_columns, edges, n_folds)
    if rows is None:
        return None
    band = factorise_band(rows, cutoffs.scored, n_folds)
    return _Search(band, candidates, model, measured).run()


@dataclass(frozen=True)
class _Candidate:
    """One column of friction: its kind, and its shape parameter, rad/s or m/s."""

    kind: Kind
    speed: float = 0.0


def _list_candidates(drive: Drive, fastest: float) -> list[_Candidate]:
    """Return the columns that a drive may have: signs of all smoothings, the given one first, then other terms."""
    speeds = [drive.smoothing, *(share * fastest for share in _SMOOTHINGS)]
    signs = [_Candidate(Kind.COULOMB, speed) for speed in speeds]
    return [*signs, _Candidate(Kind.ASYMMETRY), _Candidate(Kind.QUADRATIC)]


def _find_largest_speeds(pieces: Sequence[Piece], rate: float, model: FrictionModel) -> FloatArray:
    """Return the speed that each drive exceeds in one of a hundred samples, rad/s or m/s, (n_drives,)."""
    speeds = np.concatenate(
        [np.gradient(np.asarray(piece.signals.z), 1 / rate, axis=0) for piece in pieces]
    )
    weights = np.array([drive.weights[list(model.independent)] for drive in model.drives])
    result: FloatArray = np.quantile(np.abs(speeds @ weights.T), 0.99, axis=0)
    return np.maximum(result, 1e-9)


def _compute_friction(
    drive: Drive, candidates: Sequence[_Candidate], dz: FloatArray, independent: tuple[int, ...]
) -> FloatArray:
    """Return the torques of unit values of a drive's candidates, (n_samples, n_dof, n_candidates)."""
    weights = drive.weights[list(independent)]
    speed = dz @ weights
    columns = []
    for candidate in candidates:
        if candidate.kind is Kind.ASYMMETRY:
            columns.append(np.abs(speed))
        elif candidate.kind is Kind.QUADRATIC:
            columns.append(speed * np.abs(speed))
        elif candidate.speed > 0:
            columns.append(np.tanh(speed / candidate.speed))
        else:
            columns.append(np.sign(speed))
    return np.stack(columns, axis=1)[:, None, :] * weights[:, None]


_Choice = tuple[tuple[int, ...], ...]
"""Indices of each drive's candidates that are in the model, the sign first."""


class _Search:
    """A search for the candidates that predict left-out folds best.

    Args:
        band: Triangular factors of all columns.
        candidates: Candidates of each drive.
        model: The drives.
        measured: Joints whose torques are measured, (n_dof,).
    """

    def __init__(
        self,
        band: Band,
        candidates: Sequence[Sequence[_Candidate]],
        model: FrictionModel,
        measured: BoolArray,
    ) -> None:
        self._candidates, self._model = candidates, model
        counts = [len(own) for own in candidates]
        self._n_rest = band.factors.shape[-1] - 1 - sum(counts)
        self._starts = self._n_rest + np.cumsum([0, *counts[:-1]])
        start: _Choice = tuple((0,) for _ in candidates)
        columns = self._list_columns(start)
        factors = band.factors[..., [*columns, -1]]
        squares = np.sum(factors[..., -1] ** 2, axis=(0, 2)) / band.n_samples
        scale = np.where(measured & (squares > 0), np.sqrt(squares), np.inf)
        noise = estimate_joint_noise(factors, scale, band.n_samples)
        weighted = band.factors / noise[:, None, None]
        plain = band.factors[:, measured]
        self._weighted = np.einsum("fjak,fjal->fkl", weighted, weighted)
        self._plain = np.einsum("fjak,fjal->fkl", plain, plain)
        self._start = start

    def _list_columns(self, choice: _Choice) -> list[int]:
        """Return the columns of a choice."""
        own = [int(s) + k for s, chosen in zip(self._starts, choice, strict=True) for k in chosen]
        return [*range(self._n_rest), *own]

    def _compute_errors(self, choice: _Choice) -> FloatArray:
        """Return the squared error on each fold, relative to the torques of all folds, (n_folds,)."""
        columns = np.array(self._list_columns(choice))
        whole = self._weighted.sum(axis=0)
        power = self._plain[:, -1, -1].sum()
        errors = []
        for fold, tested in zip(self._weighted, self._plain, strict=True):
            G = whole - fold
            lengths = np.sqrt(np.maximum(np.diag(G)[columns], 1e-300))
            A = G[np.ix_(columns, columns)] / np.outer(lengths, lengths)
            A[np.diag_indices_from(A)] += _RIDGE
            values = scipy.linalg.solve(A, G[columns, -1] / lengths, assume_a="pos") / lengths
            left = (
                tested[-1, -1]
                - 2 * tested[columns, -1] @ values
                + values @ tested[np.ix_(columns, columns)] @ values
            )
            errors.append(max(0.0, float(left)) / power)
        return np.array(errors)

    def run(self) -> FrictionSearch:
        """Return the choice: one smoothing for all drives, then one for each, then terms one after the other."""
        choice, best = self._start, self._score(self._start)
        usual = best
        for k in range(1, 1 + len(_SMOOTHINGS)):
            common = tuple((0,) if fixed else (k,) for fixed in self._model.fixed)
            choice, best = min([(choice, best), (common, self._score(common))], key=lambda x: x[1])
        for _ in range(_SWEEPS):
            choice, best = self._refine(choice, best)
        choice, best = self._add_terms(choice, best)
        return self._describe(choice, best, usual)

    def _score(self, choice: _Choice) -> float:
        """Return the relative error over all folds."""
        return float(np.sqrt(self._compute_errors(choice).sum()))

    def _refine(self, choice: _Choice, best: float) -> tuple[_Choice, float]:
        """Return the choice with another smoothing for those drives that gain by it."""
        for j, fixed in enumerate(self._model.fixed):
            for k in range(0 if fixed else 1 + len(_SMOOTHINGS)):
                other = (*choice[:j], (k,), *choice[j + 1 :])
                error = self._score(other)
                if error < (1 - _GAIN) * best:
                    choice, best = other, error
        return choice, best

    def _add_terms(self, choice: _Choice, best: float) -> tuple[_Choice, float]:
        """Return the choice with the terms that lower the error, the most useful first."""
        while True:
            found = []
            before = self._compute_errors(choice)
            for j, own in enumerate(self._candidates):
                for k in range(1, len(own)):
                    if k in choice[j] or self._is_second_sign(j, choice[j], k):
                        continue
                    other = (*choice[:j], (*choice[j], k), *choice[j + 1 :])
                    errors = self._compute_errors(other)
                    worse = int(np.count_nonzero(errors > before))
                    if worse <= len(errors) // 4:
                        found.append((float(np.sqrt(errors.sum())), other))
            error, other = min(found, default=(np.inf, choice))
            if error >= (1 - _TERM_GAIN) * best:
                return choice, best
            choice, best = other, error

    def _is_second_sign(self, j: int, chosen: tuple[int, ...], k: int) -> bool:
        """Return whether a candidate is a sign that cannot be added: a drive has two signs at most, the second one of a
        larger speed.
        """
        own = self._candidates[j]
        if own[k].kind is not Kind.COULOMB:
            return False
        signs = [own[i].speed for i in chosen if own[i].kind is Kind.COULOMB]
        return len(signs) > 1 or own[k].speed <= signs[0]

    def _describe(self, choice: _Choice, best: float, usual: float) -> FrictionSearch:
        """Return the choice as a record."""
        chosen = [
            [own[k] for k in indices] for own, indices in zip(self._candidates, choice, strict=True)
        ]
        signs = [[c.speed for c in own if c.kind is Kind.COULOMB] for own in chosen]
        kinds = [{c.kind for c in own} for own in chosen]
        return FrictionSearch(
            drives=tuple(drive.name for drive in self._model.drives),
            smoothing=np.array([own[0] for own in signs]),
            stribeck_velocity=np.array([own[1] if len(own) > 1 else np.nan for own in signs]),
            asymmetry=np.array([Kind.ASYMMETRY in own for own in kinds]),
            quadratic=np.array([Kind.QUADRATIC in own for own in kinds]),
            error=best,
            usual_error=usual,
        )
