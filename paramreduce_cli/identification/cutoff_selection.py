"""Cut-off frequencies of low-pass filters, chosen by cross-validation within the training part.

All frequencies are on one geometric grid that begins with the frequency of the motion. Each state cut-off gives other
states and so another observation matrix; parameters are fitted to torques below one frequency and scored on torques
below another one. The scored band ends where the model no longer explains most of the power of the torques, because
above it noise, or the low-pass of a controller, is all that remains.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.identification import filters
from paramreduce_cli.identification.data_split import Piece
from paramreduce_cli.identification.state_estimation import (
    Cutoffs,
    compute_edge,
    cut_ends,
    estimate_states,
)
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.noise import estimate_joint_noise
from paramreduce_cli.multibody.observation import combine_factors
from paramreduce_cli.multibody.orthogonal import solve_least_squares
from paramreduce_cli.records import BoolArray, CutoffSearch, FloatArray, IntArray, Spectra

ComputeColumns = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""Returns the columns of the observation matrix for states z, dz, ddz: (n_samples, n_dof, n)."""

_RATIO = 1.5
"""Ratio of neighbouring frequencies of the grid."""
_N_STATES = 11
"""Largest number of state cut-offs."""
_N_BANDS = 8
"""Largest number of bands of torques."""
_MOTION_POWER = 0.999
"""Share of the positions' power at frequencies up to that of the motion."""
_PER_BAND = 8
"""Samples per period of the highest band that the observation matrix is computed in."""
_USED_PER_BAND = 10
"""Samples per period of a band that are fitted."""
_MOST_SAMPLES = 8_000
"""Samples of the observation matrix for one state cut-off; of longer logs windows are taken."""
_FEWEST = 20
"""Samples of each fold."""
_LEAST_KEPT = 0.8
"""Share of the samples that has to keep all neighbours of a low-pass of positions."""
_UNEXPLAINED = 0.5
"""Share of the power of a band that the model may leave."""
_HOPELESS = 1.5
"""Ratio of an error to the smallest one from which on higher state cut-offs are not tried."""
_TIED = 1.02
"""Ratio of errors up to which cut-offs are as good as each other."""


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
class _Band:
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
class _Rows:
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


def select_cutoffs(
    pieces: Sequence[Piece],
    rate: float,
    spectra: Spectra,
    compute_columns: ComputeColumns,
    measured: BoolArray,
    given: tuple[float | None, float | None],
    n_folds: int,
) -> CutoffSearch | None:
    """Choose the cut-off frequencies with which a model predicts the torques of left-out folds best.

    Args:
        pieces: Training pieces as recorded.
        rate: Recorded samples per second.
        spectra: Spectra of speeds and torques.
        compute_columns: Function that returns the columns of the base parameters.
        measured: Joints whose torques are measured, (n_dof,).
        given: Cut-off frequencies of states and torques that the config gives, Hz; None for those to be chosen.
        n_folds: Number of folds.

    Returns:
        The search, or None if the log is too short for one.
    """
    motion = find_motion_frequency(spectra)
    bands = _make_grid(motion, rate, _N_BANDS)
    if given[1] is not None and np.isfinite(given[1]):
        bands = np.unique([*bands, given[1]])
    states = _make_grid(motion, rate, _N_STATES)
    if states[-1] > 0.3 * rate:
        states = np.append(states, np.inf)
    if given[0] is not None:
        states = np.array([given[0]])
    edges = [_find_common_edges(pieces, rate, states[k:]) for k in range(states.size)]
    whole = _count_used(pieces, np.zeros(len(pieces)))
    first = next(
        (k for k, edge in enumerate(edges) if _count_used(pieces, edge) >= _LEAST_KEPT * whole),
        states.size - 1,
    )
    states, edge = states[first:], edges[first]
    tried: list[list[_Band]] = []
    errors: list[float] = []
    unexplained = np.zeros(0)
    for state in states:
        rows = _compute_rows(
            pieces, rate, float(state), float(bands[-1]), compute_columns, edge, n_folds
        )
        if rows is None:
            return None
        own = [_factorise_band(rows, float(band), n_folds) for band in bands]
        tried.append(own)
        errors.append(_score(own, 1, 1, measured))
        if errors[-1] == min(errors):
            parameters = _cross_fit(own[min(1, len(own) - 1)], measured)
            unexplained = _compute_unexplained(rows, bands, parameters, measured)
        if min(errors[-2:]) > _HOPELESS * min(errors):
            break
    states = states[: len(tried)]
    scored = _find_explained(unexplained)
    state_errors = np.array([_score(own, scored, scored, measured) for own in tried])
    state = _choose_state(state_errors)
    torque_errors = np.array([_score(tried[state], k, scored, measured) for k in range(bands.size)])
    torque = float(bands[scored]) if given[1] is None else given[1]
    return CutoffSearch(
        state=float(states[state]),
        torque=torque,
        scored=float(bands[scored]),
        states=states,
        state_errors=state_errors,
        bands=bands,
        torque_errors=torque_errors,
        unexplained=unexplained,
    )


def find_motion_frequency(spectra: Spectra) -> float:
    """Return the frequency up to which the positions of all joints together have 99.9 % of their power, Hz.

    Noise of speeds may have more power than their motion; noise of positions has not.
    """
    positions = spectra.velocity.sum(axis=1) / spectra.frequency**2
    power = np.cumsum(positions)
    return float(spectra.frequency[np.searchsorted(power, _MOTION_POWER * power[-1])])


def _make_grid(first: float, rate: float, count: int) -> FloatArray:
    """Return a geometric grid of frequencies well below half of the rate, at least one, Hz."""
    grid = np.array([first * _RATIO**k for k in range(count)])
    return grid[: max(1, int(np.sum(grid < 0.4 * rate)))]


def _find_common_edges(pieces: Sequence[Piece], rate: float, states: FloatArray) -> FloatArray:
    """Return the time at the ends of each piece that the longest low-pass takes, s, (n_pieces,)."""
    return np.array([compute_edge(piece, rate, float(states.min())) for piece in pieces])


def _count_used(pieces: Sequence[Piece], edges: FloatArray) -> int:
    """Return the number of used samples without those at the ends of pieces."""
    used = [cut_ends(piece, edge).used for piece, edge in zip(pieces, edges, strict=True)]
    return sum(one.stop - one.start for one in used)


def _compute_rows(
    pieces: Sequence[Piece],
    rate: float,
    state: float,
    highest: float,
    compute_columns: ComputeColumns,
    edges: FloatArray,
    n_folds: int,
) -> _Rows | None:
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
    needed = max(_PER_BAND * highest, 6 * state if np.isfinite(state) else rate)
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
    return _Rows(values, [piece.used for piece in windows], folds, rate / decimation)


def _factorise_band(rows: _Rows, frequency: float, n_folds: int) -> _Band:
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
    """Return the pieces; of long ones a window at the beginning of each tenth."""
    total = sum(piece.signals.time.size for piece in pieces)
    if total <= _MOST_SAMPLES:
        return list(pieces)
    share = _MOST_SAMPLES / total
    windows = []
    for piece in pieces:
        size = piece.signals.time.size // 10
        for k in range(10):
            rows = slice(k * size, k * size + max(1, int(share * size)))
            windows.append(piece.slice_rows(rows))
    return windows


def _factorise(folds: Sequence[FloatArray]) -> _Band:
    """Return the triangular factors of the rows of each fold, (n_samples, n_dof, n + 1) each."""
    n_dof, k = folds[0].shape[1:]
    factors = np.zeros((len(folds), n_dof, k, k))
    for fold, rows in enumerate(folds):
        R: FloatArray = np.linalg.qr(rows.transpose(1, 0, 2), mode="r")  # type: ignore[assignment]
        factors[fold, :, : R.shape[1]] = R
    return _Band(factors, sum(len(rows) for rows in folds))


def _score(bands: Sequence[_Band], fitted: int, scored: int, measured: BoolArray) -> float:
    """Return the relative error on torques of one band in cross-validation, of parameters fitted to another band."""
    fitted, scored = min(fitted, len(bands) - 1), min(scored, len(bands) - 1)
    parameters = _cross_fit(bands[fitted], measured)
    band = bands[scored]
    return float(np.sqrt(band.compute_left(parameters, measured) / band.compute_power(measured)))


def _cross_fit(band: _Band, measured: BoolArray) -> list[FloatArray]:
    """Return the parameters fitted without each fold."""
    squares = np.sum(band.factors[..., -1] ** 2, axis=(0, 2)) / band.n_samples
    scale = np.where(measured & (squares > 0), np.sqrt(squares), np.inf)
    return [band.fit(fold, scale) for fold in range(len(band.factors))]


def _compute_unexplained(
    rows: _Rows, bands: FloatArray, parameters: Sequence[FloatArray], measured: BoolArray
) -> FloatArray:
    """Return the share of the torques' power between each band and the one before that the model leaves, (n_bands,).

    Args:
        rows: Columns and torques for one state cut-off.
        bands: Frequencies, Hz.
        parameters: Parameters for each fold, fitted without that fold.
        measured: Joints whose torques are measured, (n_dof,).
    """
    left, power = np.zeros(bands.size), np.zeros(bands.size)
    for values, used, fold in zip(rows.values, rows.used, rows.folds, strict=True):
        tau = values[:, measured, -1]
        # A fold's parameters predict its neighbours too, which the filter needs at the fold's ends.
        for k in np.unique(fold):
            own = np.zeros(len(values), dtype=bool)
            own[used] = fold == k
            residual = tau - values[:, measured, :-1] @ parameters[k]
            for signal, total in ((residual, left), (tau, power)):
                lower = np.zeros_like(signal)
                for i, frequency in enumerate(bands):
                    taps = filters.design_low_pass(float(frequency), rows.rate)
                    upper = filters.apply_filter(signal, taps)
                    total[i] += np.sum((upper - lower)[own] ** 2)
                    lower = upper
    return left / np.maximum(power, 1e-300)


def _find_explained(unexplained: FloatArray) -> int:
    """Return the last band before the first that is mostly unexplained; at least the first one."""
    failing = np.flatnonzero(unexplained > _UNEXPLAINED)
    return max(0, int(failing[0]) - 1) if failing.size else unexplained.size - 1


def _choose_state(errors: FloatArray) -> int:
    """Return the cut-off above the lowest one that is as good as the best one, if it is as good, too.

    Higher cut-offs let more noise pass; the lowest one has worse ones beside it.
    """
    good = np.flatnonzero(errors <= _TIED * errors.min())
    first = int(good[0])
    return first + 1 if first + 1 in good else first
