"""Parameters fitted to the torques of one band without each fold, and scored on that fold.

A log is low-passed in each of several ways here, so windows of it are taken, and rows are compressed to triangular factors.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.identification import filters
from paramreduce_cli.identification.data_split import Piece
from paramreduce_cli.identification.state_estimation import (
    PER_STATE_CUTOFF,
    Cutoffs,
    cut_ends,
    estimate_states,
)
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.noise import estimate_joint_noise
from paramreduce_cli.multibody.observation import combine_factors
from paramreduce_cli.multibody.orthogonal import solve_least_squares
from paramreduce_cli.records import BoolArray, FloatArray, IntArray

ComputeColumns = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""Returns the columns of the observation matrix for states z, dz, ddz: (n_samples, n_dof, n)."""

_PER_BAND = 8
"""Samples per period of the highest band that the observation matrix is computed in."""
_USED_PER_BAND = 10
"""Samples per period of a band that are fitted."""
_MOST_SAMPLES = 8_000
"""Samples of the observation matrix for one state cut-off; of longer logs windows are taken."""
_N_WINDOWS = 10
"""Windows of a piece."""
_FEWEST = 20
"""Samples of each fold."""


def make_column_function(dynamics: Dynamics, columns: IntArray) -> ComputeColumns:
    """Return a function of independent states that computes some columns of the observation matrix.

    Args:
        dynamics: Dynamics of the robot.
        columns: Indices of the base parameters' columns.
    """
    coordinates = Coordinates(dynamics.mechanism, once=True)

    def compute_columns(z: FloatArray, dz: FloatArray, ddz: FloatArray) -> FloatArray:
        """Return the columns for some states, (n_samples, n_dof, n)."""
        states = coordinates.compute_states(z, dz, ddz)
        return dynamics.compute_regressor(*states)[:, :, columns]

    return compute_columns


@dataclass(frozen=True)
class Band:
    """The triangular factors of the columns and torques below one frequency.

    Attributes:
        factors: Factors of [W | tau] by fold and joint, (n_folds, n_dof, n + 1, n + 1).
        n_samples: Number of samples.
    """

    factors: FloatArray
    n_samples: int

    def fit(self, fold: int, scale: FloatArray) -> FloatArray:
        """Return the parameters fitted to all folds but one, each joint weighted by its noise, (n,)."""
        rest = np.delete(self.factors, fold, axis=0)
        n_samples = self.n_samples * len(rest) // len(self.factors)
        return solve_least_squares(
            combine_factors(rest, estimate_joint_noise(rest, scale, n_samples))
        )

    def compute_left(self, parameters: Sequence[FloatArray], measured: BoolArray) -> float:
        """Return the mean square of the residuals in each fold of the parameters for that fold, summed over joints."""
        own = self.factors[:, measured]
        left = [
            factor[..., -1] - factor[..., :-1] @ values
            for factor, values in zip(own, parameters, strict=True)
        ]
        return float(np.sum(np.square(left))) / self.n_samples

    def compute_power(self, measured: BoolArray) -> float:
        """Return the mean square of the torques, summed over joints."""
        return float(np.sum(self.factors[:, measured, :, -1] ** 2)) / self.n_samples


@dataclass(frozen=True)
class WindowRows:
    """The columns and torques of windows of the log for one state cut-off.

    Attributes:
        values: [W | tau] of each window, (n_samples, n_dof, n + 1).
        used: Samples of each window that are used; the others serve filters.
        folds: Folds of the used samples of each window.
        rate: Samples per second.
    """

    values: list[FloatArray]
    used: list[slice]
    folds: list[IntArray]
    rate: float


def compute_rows(
    pieces: Sequence[Piece],
    rate: float,
    state: float,
    highest: float,
    compute_columns: ComputeColumns,
    edges: FloatArray,
    n_folds: int,
) -> WindowRows | None:
    """Return columns and torques for one state cut-off, or None if a fold has hardly any samples.

    Args:
        pieces: Training pieces as recorded.
        rate: Recorded samples per second.
        state: State cut-off, Hz.
        highest: Highest frequency of torques, Hz.
        compute_columns: Function that returns the columns of the base parameters.
        edges: Time at the ends of each piece that is not used, s.
        n_folds: Number of folds.
    """
    needed = max(_PER_BAND * highest, PER_STATE_CUTOFF * state if np.isfinite(state) else rate)
    decimation = max(1, int(rate / needed + 1e-9))
    ready = [
        cut_ends(estimate_states(piece, rate, Cutoffs(state, highest), decimation), edge)
        for piece, edge in zip(pieces, edges, strict=True)
    ]
    windows = _take_windows([piece for piece in ready if piece.used.stop > piece.used.start])
    sizes = [piece.used.stop - piece.used.start for piece in windows]
    if sum(sizes) < n_folds * _FEWEST:
        return None
    folds = np.split(np.arange(sum(sizes)) * n_folds // sum(sizes), np.cumsum(sizes)[:-1])
    values = []
    for piece in windows:
        s = piece.signals
        assert s.dz is not None
        assert s.ddz is not None
        W = compute_columns(np.asarray(s.z), np.asarray(s.dz), np.asarray(s.ddz))
        values.append(np.concatenate([W, np.asarray(s.tau)[..., None]], axis=2))
    return WindowRows(values, [piece.used for piece in windows], folds, rate / decimation)


def factorise_band(rows: WindowRows, frequency: float, n_folds: int) -> Band:
    """Return the factors of columns and torques below a frequency, Hz."""
    taps = filters.design_low_pass(frequency, rows.rate)
    every = max(1, int(rows.rate / (_USED_PER_BAND * frequency)))
    parts: list[list[FloatArray]] = [[] for _ in range(n_folds)]
    for values, used, fold in zip(rows.values, rows.used, rows.folds, strict=True):
        outputs = np.arange(used.start, used.stop, every)
        flat = filters.filter_outputs(values.reshape(len(values), -1), taps, outputs)
        low = flat.reshape(-1, *values.shape[1:])
        for k in range(n_folds):
            parts[k].append(low[fold[::every] == k])
    return _factorise([np.concatenate(part) for part in parts])


def _take_windows(pieces: Sequence[Piece]) -> list[Piece]:
    """Return the pieces; of long ones some windows."""
    total = sum(piece.signals.time.size for piece in pieces)
    if total <= _MOST_SAMPLES:
        return list(pieces)
    share = _MOST_SAMPLES / total
    windows = []
    for piece in pieces:
        size = piece.signals.time.size // _N_WINDOWS
        for k in range(_N_WINDOWS):
            rows = slice(k * size, k * size + max(1, int(share * size)))
            windows.append(piece.slice_rows(rows))
    return windows


def _factorise(folds: Sequence[FloatArray]) -> Band:
    """Return the triangular factors of the rows of each fold, (n_samples, n_dof, n + 1) each."""
    n_dof, k = folds[0].shape[1:]
    factors = np.zeros((len(folds), n_dof, k, k))
    for fold, rows in enumerate(folds):
        R: FloatArray = np.linalg.qr(rows.transpose(1, 0, 2), mode="r")  # type: ignore[assignment]
        factors[fold, :, : R.shape[1]] = R
    return Band(factors, sum(len(rows) for rows in folds))


def score(bands: Sequence[Band], fitted: int, scored: int, measured: BoolArray) -> float:
    """Return the relative error on torques of one band in cross-validation, of parameters fitted to another band."""
    fitted, scored = min(fitted, len(bands) - 1), min(scored, len(bands) - 1)
    parameters = cross_fit(bands[fitted], measured)
    band = bands[scored]
    power = max(band.compute_power(measured), 1e-300)
    return float(np.sqrt(band.compute_left(parameters, measured) / power))


def cross_fit(band: Band, measured: BoolArray) -> list[FloatArray]:
    """Return the parameters fitted without each fold."""
    squares = np.sum(band.factors[..., -1] ** 2, axis=(0, 2)) / band.n_samples
    scale = np.where(measured & (squares > 0), np.sqrt(squares), np.inf)
    return [band.fit(fold, scale) for fold in range(len(band.factors))]
