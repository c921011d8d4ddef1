"""The shape of friction, chosen by cross-validation within the training part.

Friction is linear in its parameters but for a few shape parameters: the speed at which Coulomb friction is smoothed, and
the speed beyond which Stribeck friction fades. Given these, all parameters follow from linear least squares (separable
least squares [Golub2003]). The columns of all candidate shapes are computed once, so that each candidate costs one small
fit.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # whose parts load when they are first used

from paramreduce_cli.identification.band_scoring import (
    Band,
    ComputeColumns,
    compute_rows,
    factorise_band,
    make_column_function,
)
from paramreduce_cli.identification.data_split import Piece
from paramreduce_cli.identification.state_estimation import (
    PER_STATE_CUTOFF,
    Cutoffs,
    choose_decimation,
    compute_edge,
    estimate_states,
)
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

_RATIO = 1.5
"""Ratio of neighbouring speeds of smoothing."""
_SMOOTHINGS = (0.0, *(0.01 * _RATIO**k for k in range(10)))
"""Speeds of smoothing that are tried, a share of the largest speed of the drive."""
_FRICTION = (Kind.COULOMB, Kind.STRIBECK, Kind.ASYMMETRY, Kind.QUADRATIC)
_GAIN = 0.005
"""Relative decrease of the error for which a joint gets another smoothing than the others."""
_TERM_GAIN = 0.02
"""Relative decrease of the error for which a term is added."""
_GEOMETRIC = 2
"""First of the candidates of a drive whose speeds form a geometric sequence: after the given smoothing and the sign."""
_STEP = 0.05
"""Accuracy of smoothings, in steps between candidates."""
_LEAST_RATIO = 4.0
"""Ratio of the speed beyond which Stribeck friction fades to that of the smoothing."""
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
    fastest = _find_largest_speeds(pieces, rate, cutoffs.state, model)
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


@dataclass(frozen=True)
class _Choice:
    """The friction of one drive.

    Attributes:
        sign: Index of the candidate for the sign; between two of the geometric smoothings it is not a whole number.
        terms: Indices of further candidates.
    """

    sign: float
    terms: tuple[int, ...] = ()


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
        self._start = tuple(_Choice(0) for _ in candidates)
        T = self._combine_columns(self._start, band.factors.shape[-1])
        factors = band.factors @ T
        squares = np.sum(factors[..., -1] ** 2, axis=(0, 2)) / band.n_samples
        scale = np.where(measured & (squares > 0), np.sqrt(squares), np.inf)
        noise = estimate_joint_noise(factors, scale, band.n_samples)
        weighted = band.factors / noise[:, None, None]
        plain = band.factors[:, measured]
        self._weighted = np.einsum("fjak,fjal->fkl", weighted, weighted)
        self._plain = np.einsum("fjak,fjal->fkl", plain, plain)

    def _combine_columns(self, choices: Sequence[_Choice], n: int) -> FloatArray:
        """Return the matrix that makes the columns of a choice, and the torques last, of all columns, (n, n_chosen + 1).

        Smoothings between those of the candidates are interpolated: columns are smooth in the logarithm of the speed.
        """
        columns: list[FloatArray] = list(np.eye(n)[: self._n_rest])
        for start, choice in zip(self._starts.tolist(), choices, strict=True):
            nodes, weights = _interpolate(choice.sign)
            column = np.zeros(n)
            column[start + nodes] = weights
            columns += [column, *(np.eye(n)[start + k] for k in choice.terms)]
        return np.column_stack([*columns, np.eye(n)[-1]])

    def _compute_errors(self, choices: Sequence[_Choice]) -> FloatArray:
        """Return the squared error on each fold, relative to the torques of all folds, (n_folds,)."""
        T = self._combine_columns(choices, self._plain.shape[-1])
        weighted, plain = T.T @ self._weighted @ T, T.T @ self._plain @ T
        least = _RIDGE * np.diag(weighted.sum(axis=0))[:-1] + 1e-300
        errors = []
        for k, tested in enumerate(plain):
            G = np.delete(weighted, k, axis=0).sum(axis=0)
            # A joint may move in one fold only; its columns are rounding elsewhere.
            lengths = np.sqrt(np.maximum(np.diag(G)[:-1], least))
            A = G[:-1, :-1] / np.outer(lengths, lengths)
            A[np.diag_indices_from(A)] += _RIDGE
            values = scipy.linalg.solve(A, G[:-1, -1] / lengths, assume_a="pos") / lengths
            residual = np.append(-values, 1.0)
            errors.append(max(0.0, float(residual @ tested @ residual)))
        return np.array(errors) / plain[:, -1, -1].sum()

    def run(self) -> FrictionSearch:
        """Return the choice: one smoothing for all drives, then one for each, then terms one after the other."""
        choices, best = self._start, self._score(self._start)
        usual = best
        for k in range(1, 1 + len(_SMOOTHINGS)):
            common = tuple(_Choice(0 if fixed else k) for fixed in self._model.fixed)
            error = self._score(common)
            choices, best = (common, error) if error < best else (choices, best)
        for _ in range(_SWEEPS):
            choices, best = self._choose_smoothings(choices, best)
        choices, best = self._refine_smoothings(choices, best)
        choices, best = self._add_terms(choices, best)
        return self._describe(choices, best, usual)

    def _score(self, choices: Sequence[_Choice]) -> float:
        """Return the relative error over all folds."""
        return float(np.sqrt(self._compute_errors(choices).sum()))

    def _choose_smoothings(
        self, choices: tuple[_Choice, ...], best: float
    ) -> tuple[tuple[_Choice, ...], float]:
        """Return the choice with another smoothing for those drives that gain by it."""
        for j, fixed in enumerate(self._model.fixed):
            for k in range(0 if fixed else 1 + len(_SMOOTHINGS)):
                other = (*choices[:j], _Choice(k), *choices[j + 1 :])
                error = self._score(other)
                if error < (1 - _GAIN) * best:
                    choices, best = other, error
        return choices, best

    def _refine_smoothings(
        self, choices: tuple[_Choice, ...], best: float
    ) -> tuple[tuple[_Choice, ...], float]:
        """Return the choice with smoothings between those of the candidates."""
        last = float(len(_SMOOTHINGS))
        for j, choice in enumerate(choices):
            if choice.sign < _GEOMETRIC:
                continue

            def score(sign: float, j: int = j, others: tuple[_Choice, ...] = choices) -> float:
                """Return the error with a sign of the j-th drive."""
                return self._score((*others[:j], _Choice(sign), *others[j + 1 :]))

            bounds = max(_GEOMETRIC, choice.sign - 1), min(last, choice.sign + 1)
            found = scipy.optimize.minimize_scalar(
                score, bounds=bounds, method="bounded", options={"xatol": _STEP}
            )
            if found.fun < best:
                choices = (*choices[:j], _Choice(float(found.x)), *choices[j + 1 :])
                best = float(found.fun)
        return choices, best

    def _add_terms(
        self, choices: tuple[_Choice, ...], best: float
    ) -> tuple[tuple[_Choice, ...], float]:
        """Return the choice with the terms that lower the error, the most useful first."""
        while True:
            found: list[tuple[float, tuple[_Choice, ...]]] = []
            before = self._compute_errors(choices)
            for j, choice in enumerate(choices):
                for k in self._list_terms(j, choice):
                    changed = _Choice(choice.sign, (*choice.terms, k))
                    other = (*choices[:j], changed, *choices[j + 1 :])
                    errors = self._compute_errors(other)
                    if np.count_nonzero(errors > before) <= errors.size // 4:
                        found.append((float(np.sqrt(errors.sum())), other))
            error, other = min(found, default=(np.inf, choices), key=lambda entry: entry[0])
            if error >= (1 - _TERM_GAIN) * best:
                return choices, best
            choices, best = other, error

    def _list_terms(self, j: int, choice: _Choice) -> list[int]:
        """Return the candidates that may be added to a drive's friction.

        A second sign has to have a much larger speed than the first one: with nearly the same speed it only makes up for a
        smoothing that is a little wrong.
        """
        own = self._candidates[j]
        second = any(own[k].kind is Kind.COULOMB for k in choice.terms)
        least = _LEAST_RATIO * self._get_speed(j, choice)
        return [
            k
            for k in range(1, len(own))
            if k not in choice.terms
            and (own[k].kind is not Kind.COULOMB or (not second and own[k].speed > least))
        ]

    def _get_speed(self, j: int, choice: _Choice) -> float:
        """Return the speed of the smoothing of a drive, rad/s or m/s."""
        own = self._candidates[j]
        if choice.sign < _GEOMETRIC:
            return own[int(choice.sign)].speed
        return float(own[_GEOMETRIC].speed * _RATIO ** (choice.sign - _GEOMETRIC))

    def _describe(self, choices: Sequence[_Choice], best: float, usual: float) -> FrictionSearch:
        """Return the choice as a record."""
        terms = [
            [own[k] for k in choice.terms]
            for own, choice in zip(self._candidates, choices, strict=True)
        ]
        kinds = [{term.kind for term in own} for own in terms]
        fading = [[term.speed for term in own if term.kind is Kind.COULOMB] for own in terms]
        return FrictionSearch(
            drives=tuple(drive.name for drive in self._model.drives),
            smoothing=np.array([self._get_speed(j, choice) for j, choice in enumerate(choices)]),
            stribeck_velocity=np.array([own[0] if own else np.nan for own in fading]),
            asymmetry=np.array([Kind.ASYMMETRY in own for own in kinds]),
            quadratic=np.array([Kind.QUADRATIC in own for own in kinds]),
            error=best,
            usual_error=usual,
        )


def _interpolate(sign: float) -> tuple[IntArray, FloatArray]:
    """Return the candidates that a sign is made of, and their weights: cubic interpolation in the logarithm of the speed."""
    if sign == int(sign):
        return np.array([int(sign)]), np.ones(1)
    first = int(np.clip(int(sign) - 1, _GEOMETRIC, len(_SMOOTHINGS) - 3))
    nodes = first + np.arange(4)
    weights = [
        np.prod([(sign - other) / (node - other) for other in nodes if other != node])
        for node in nodes
    ]
    return nodes, np.array(weights)
