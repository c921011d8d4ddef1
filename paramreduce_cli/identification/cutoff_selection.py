"""Cut-off frequencies of low-pass filters, chosen by cross-validation within the training part.

All frequencies are on one geometric grid that begins with the frequency of the motion. Each state cut-off gives other
states and so another observation matrix; parameters are fitted to torques below one frequency and scored on torques
below another one. The scored band ends where the model no longer explains most of the power of the torques, because
above it noise, or the low-pass of a controller, is all that remains.
"""

from collections.abc import Sequence

import numpy as np

from paramreduce_cli.identification import filters
from paramreduce_cli.identification.band_scoring import (
    Band,
    ComputeColumns,
    WindowRows,
    compute_rows,
    cross_fit,
    factorise_band,
    score,
)
from paramreduce_cli.identification.data_split import Piece
from paramreduce_cli.identification.state_estimation import compute_edge, cut_ends
from paramreduce_cli.records import BoolArray, CutoffSearch, FloatArray, Spectra

_RATIO = 1.5
"""Ratio of neighbouring frequencies of the grid."""
_N_STATES = 11
"""Largest number of state cut-offs."""
_N_BANDS = 8
"""Largest number of bands of torques."""
_MOTION_POWER = 0.999
"""Share of the positions' power at frequencies up to that of the motion."""
_LEAST_KEPT = 0.8
"""Share of the samples that has to keep all neighbours of a low-pass of positions."""
_HIGHEST = 0.4
"""Highest frequency of the grid, a share of the rate."""
_WITHOUT_LOW_PASS = 0.3
"""Highest state cut-off, a share of the rate, from which on no low-pass at all is tried too."""
_UNEXPLAINED = 0.5
"""Share of the power of a band that the model may leave."""
_HOPELESS = 1.5
"""Ratio of an error to the smallest one from which on higher state cut-offs are not tried."""
_TIED = 1.02
"""Ratio of errors up to which cut-offs are as good as each other."""


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
    states, edges = _list_states(pieces, rate, motion, given[0])
    tried: list[list[Band]] = []
    errors: list[float] = []
    unexplained = np.zeros(0)
    for state in states.tolist():
        rows = compute_rows(pieces, rate, state, float(bands[-1]), compute_columns, edges, n_folds)
        if rows is None:
            return None
        factorised = [factorise_band(rows, float(band), n_folds) for band in bands]
        tried.append(factorised)
        errors.append(score(factorised, 1, 1, measured))
        if errors[-1] == min(errors):
            parameters = cross_fit(factorised[min(1, bands.size - 1)], measured)
            unexplained = _compute_unexplained(rows, bands, parameters, measured)
        if min(errors[-2:]) > _HOPELESS * min(errors):
            break
    scored = _find_explained(unexplained)
    state_errors = np.array([score(one, scored, scored, measured) for one in tried])
    state = _choose_state(state_errors)
    torque_errors = np.array([score(tried[state], k, scored, measured) for k in range(bands.size)])
    return CutoffSearch(
        state=float(states[state]),
        torque=float(bands[scored]) if given[1] is None else given[1],
        scored=float(bands[scored]),
        states=states[: len(tried)],
        state_errors=state_errors,
        bands=bands,
        torque_errors=torque_errors,
        unexplained=unexplained,
    )


def _list_states(
    pieces: Sequence[Piece], rate: float, motion: float, given: float | None
) -> tuple[FloatArray, FloatArray]:
    """Return the state cut-offs to be tried, Hz, and the time at the ends of each piece that none of them may use, s.

    Cut-offs whose low-pass is so long that few samples would be left are not tried.

    Args:
        pieces: Training pieces as recorded.
        rate: Recorded samples per second.
        motion: Frequency of the motion, Hz.
        given: State cut-off that the config gives, Hz; None for none.
    """
    states = _make_grid(motion, rate, _N_STATES)
    if states[-1] > _WITHOUT_LOW_PASS * rate:
        states = np.append(states, np.inf)
    if given is not None:
        states = np.array([given])
    whole = _count_used(pieces, np.zeros(len(pieces)))
    while True:
        edges = np.array([compute_edge(piece, rate, float(states[0])) for piece in pieces])
        if states.size == 1 or _count_used(pieces, edges) >= _LEAST_KEPT * whole:
            return states, edges
        states = states[1:]


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
    return grid[: max(1, int(np.sum(grid < _HIGHEST * rate)))]


def _count_used(pieces: Sequence[Piece], edges: FloatArray) -> int:
    """Return the number of used samples without those at the ends of pieces."""
    used = [cut_ends(piece, edge).used for piece, edge in zip(pieces, edges, strict=True)]
    return sum(one.stop - one.start for one in used)


def _compute_unexplained(
    rows: WindowRows, bands: FloatArray, parameters: Sequence[FloatArray], measured: BoolArray
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
