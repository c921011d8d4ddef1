"""A search for the shape of friction: smoothings that leave the smallest residual, and terms that predict left-out folds.

The columns of all candidate shapes are factorised once, so that each candidate costs one small fit. Each drive has one smoothing, and the
residual of all training data determines it better than cross-validation does (docs/lab/logs.md). Terms add parameters, so they are
cross-validated.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # whose parts load when they are first used

from paramreduce_cli.identification.band_scoring import Band
from paramreduce_cli.multibody.noise import estimate_joint_noise
from paramreduce_cli.records import BoolArray, Drive, FloatArray, IntArray, Kind

_RATIO = 1.5
"""Ratio of neighbouring speeds of smoothing."""
_SMOOTHINGS = (0.0, *(0.01 * _RATIO**k for k in range(10)))
"""Speeds of smoothing that are tried, relative to the largest speed of the drive."""
_GAIN = 0.002
"""Relative decrease of the residual for which a joint gets another smoothing than the others."""
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


@dataclass(frozen=True)
class Candidate:
    """One column of friction: its kind, and its shape parameter, rad/s or m/s."""

    kind: Kind
    speed: float = 0.0


def list_signs(drive: Drive, fastest: float) -> list[Candidate]:
    """Return the signs of all smoothings that a drive may have, the given one first."""
    speeds = [drive.smoothing, *(share * fastest for share in _SMOOTHINGS)]
    return [Candidate(Kind.COULOMB, speed) for speed in speeds]


@dataclass(frozen=True)
class _Choice:
    """The friction of one drive.

    Attributes:
        sign: Index of the candidate for the sign; between two of the geometric smoothings it is not a whole number.
        terms: Indices of further candidates.
    """

    sign: float
    terms: tuple[int, ...] = ()


@dataclass(frozen=True)
class SelectedShapes:
    """The friction that was chosen.

    Attributes:
        columns: Columns of each drive: the sign, then further terms.
        parameters: Parameters of all other columns, fitted with these to all folds, (n_rest,).
        error: Relative error of torques on left-out folds.
        usual_error: Relative error of torques on left-out folds with the friction that the search began with.
    """

    columns: tuple[tuple[Candidate, ...], ...]
    parameters: FloatArray
    error: float
    usual_error: float


class ShapeSearch:
    """A search for the shape of friction.

    Args:
        band: Triangular factors of all columns.
        candidates: Candidates of each drive, a sign first.
        given: Indices of the terms that each drive has in any case.
        fixed: Whether the config gives the smoothing of each drive, (n_drives,).
        measured: Joints whose torques are measured, (n_dof,).
    """

    def __init__(
        self,
        band: Band,
        candidates: Sequence[Sequence[Candidate]],
        given: Sequence[Sequence[int]],
        fixed: Sequence[bool],
        measured: BoolArray,
    ) -> None:
        self._candidates, self._fixed = candidates, fixed
        counts = [len(own) for own in candidates]
        self._n_rest = band.factors.shape[-1] - 1 - sum(counts)
        self._starts = self._n_rest + np.cumsum([0, *counts[:-1]])
        self._start = tuple(_Choice(0, tuple(terms)) for terms in given)
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
        least = _RIDGE * np.diag(weighted.sum(axis=0))[:-1]
        errors = []
        for k, tested in enumerate(plain):
            values = _solve_normal_equations(np.delete(weighted, k, axis=0).sum(axis=0), least)
            residual = np.append(-values, 1.0)
            errors.append(max(0.0, float(residual @ tested @ residual)))
        return np.array(errors) / plain[:, -1, -1].sum()

    def choose_smoothings(self) -> SelectedShapes:
        """Return the choice: one smoothing for all drives, then one for each."""
        choices, best = self._start, self._compute_residual(self._start)
        for k in range(1, 1 + len(_SMOOTHINGS)):
            common = tuple(
                _Choice(0 if fixed else k, choice.terms)
                for choice, fixed in zip(self._start, self._fixed, strict=True)
            )
            residual = self._compute_residual(common)
            choices, best = (common, residual) if residual < best else (choices, best)
        for _ in range(_SWEEPS):
            choices, best = self._choose_smoothings(choices, best)
        choices = self._refine_smoothings(choices, best)
        return self._describe(choices, self._score(choices), self._score(self._start))

    def choose_terms(self) -> SelectedShapes:
        """Return the first candidate of each drive with the terms that lower the error, one after the other."""
        usual = self._score(self._start)
        choices, best = self._add_terms(self._start, usual)
        return self._describe(choices, best, usual)

    def _compute_residual(self, choices: Sequence[_Choice]) -> float:
        """Return the residual of a fit to all folds, each joint weighted by its noise, relative to the torques."""
        T = self._combine_columns(choices, self._plain.shape[-1])
        G = T.T @ self._weighted.sum(axis=0) @ T
        residual = np.append(-_solve_normal_equations(G), 1.0)
        return float(np.sqrt(max(0.0, residual @ G @ residual) / G[-1, -1]))

    def _score(self, choices: Sequence[_Choice]) -> float:
        """Return the relative error over all left-out folds."""
        return float(np.sqrt(self._compute_errors(choices).sum()))

    def _choose_smoothings(
        self, choices: tuple[_Choice, ...], best: float
    ) -> tuple[tuple[_Choice, ...], float]:
        """Return the choice with another smoothing for those drives that gain by it."""
        for j, fixed in enumerate(self._fixed):
            for k in range(0 if fixed else 1 + len(_SMOOTHINGS)):
                other = (*choices[:j], _Choice(k, choices[j].terms), *choices[j + 1 :])
                residual = self._compute_residual(other)
                if residual < (1 - _GAIN) * best:
                    choices, best = other, residual
        return choices, best

    def _refine_smoothings(self, choices: tuple[_Choice, ...], best: float) -> tuple[_Choice, ...]:
        """Return the choice with smoothings between those of the candidates."""
        last = float(len(_SMOOTHINGS))
        for j, choice in enumerate(choices):
            if choice.sign < _GEOMETRIC:
                continue

            def compute_residual(
                sign: float, j: int = j, others: tuple[_Choice, ...] = choices
            ) -> float:
                """Return the residual with a sign of the j-th drive."""
                return self._compute_residual(
                    (*others[:j], _Choice(sign, others[j].terms), *others[j + 1 :])
                )

            bounds = max(_GEOMETRIC, choice.sign - 1), min(last, choice.sign + 1)
            found = scipy.optimize.minimize_scalar(
                compute_residual, bounds=bounds, method="bounded", options={"xatol": _STEP}
            )
            if found.fun < best:
                choices = (*choices[:j], _Choice(float(found.x), choice.terms), *choices[j + 1 :])
                best = float(found.fun)
        return choices

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

    def _describe(self, choices: Sequence[_Choice], best: float, usual: float) -> SelectedShapes:
        """Return the chosen columns, the errors, and the parameters fitted to all folds."""
        columns = tuple(
            (
                Candidate(Kind.COULOMB, self._get_speed(j, choice)),
                *(self._candidates[j][k] for k in choice.terms),
            )
            for j, choice in enumerate(choices)
        )
        T = self._combine_columns(choices, self._plain.shape[-1])
        values = _solve_normal_equations(T.T @ self._weighted.sum(axis=0) @ T)
        return SelectedShapes(columns, values[: self._n_rest], best, usual)


def _solve_normal_equations(G: FloatArray, least: FloatArray | float = 0.0) -> FloatArray:
    """Return the least-squares parameters, (n,).

    Args:
        G: Products of the columns and the torques with each other, (n + 1, n + 1).
        least: Smallest squared length of each column that is not taken for rounding; the parameters of shorter columns stay near zero.
    """
    lengths = np.sqrt(np.maximum(np.diag(G)[:-1], least + 1e-300))
    A = G[:-1, :-1] / np.outer(lengths, lengths)
    A[np.diag_indices_from(A)] += _RIDGE
    solution: FloatArray = scipy.linalg.solve(A, G[:-1, -1] / lengths, assume_a="pos") / lengths
    return solution


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
