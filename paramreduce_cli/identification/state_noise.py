"""Bias of parameters by noise of recorded positions: simulation and extrapolation [Cook1994].

Least squares assumes that the observation matrix is exact. Noise of positions grows in speeds and accelerations and
biases the parameters by an amount that is proportional to its variance. If as much noise again is added to the states,
the parameters shift by about their bias.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import linalg

from paramreduce_cli.identification import filters
from paramreduce_cli.identification.measured_samples import LoggedSet
from paramreduce_cli.identification.signals import Signals
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.observation import combine_factors
from paramreduce_cli.multibody.orthogonal import solve_least_squares
from paramreduce_cli.records import BoolArray, FloatArray, MeasuredLog, MeasuredMotions, Spectra

_N_PAIRS = 4
_MOST_SAMPLES = 200_000
"""Samples of the longest log that noise is added to."""
_NOTABLE = 1.0
"""Standard deviations by which noise shifts a parameter notably."""
_CONSISTENT = 4.0
"""Standard errors over the pairs that a shift has to exceed."""
_MOST_NAMED = 3


def estimate_position_noise(piece: Signals, rate: float, spectra: Spectra) -> FloatArray:
    """Return the power spectral density of the noise of the positions, rad^2/Hz or m^2/Hz, (n_dof,).

    The noise is taken as white; its density is the median over the upper half of all frequencies. Where speeds were
    recorded, nothing is known of their noise, and zeros are returned.

    Args:
        piece: Motion that the spectra are of.
        rate: Recorded samples per second.
        spectra: Spectra of the speeds, which are differences of positions.
    """
    if piece.dz is not None:
        return np.zeros(piece.z.shape[1])
    upper = spectra.frequency > 0.25 * rate
    gain = 2 * rate * np.sin(np.pi * spectra.frequency[upper] / rate)
    density: FloatArray = np.median(spectra.velocity[upper] / gain[:, None] ** 2, axis=0)
    return density


def predict_shifts(
    log: MeasuredLog,
    dynamics: Dynamics,
    columns: FloatArray,
    factors: FloatArray,
    deviation: FloatArray,
) -> FloatArray:
    """Return the shifts of parameters by each of several additional noises in the states, (n_noises, p).

    There are no rows if nothing is known of the noise, or if the log is too long.

    Args:
        log: Log, with the density of the noise of its positions.
        dynamics: Dynamics of the robot.
        columns: Matrix that expresses the model's columns by those of the standard parameters, (n_standard, p).
        factors: Factors of [W | tau] of the training samples by fold and joint.
        deviation: Divisor of the torques of each joint, infinite where none is measured, (n_dof,).
    """
    transform = linalg.block_diag(columns, 1.0)

    def solve(whole: FloatArray) -> FloatArray:
        """Return the parameters of weighted least squares."""
        return solve_least_squares(combine_factors(whole @ transform, deviation))

    before = solve(factors)
    pairs = _compute_noisy_factors(log, dynamics, np.isfinite(deviation))
    shifts = [np.mean([solve(noisy) for noisy in pair], axis=0) - before for pair in pairs]
    return np.reshape(shifts, (-1, before.size))


def _compute_noisy_factors(
    log: MeasuredLog, dynamics: Dynamics, measured: BoolArray
) -> list[tuple[FloatArray, FloatArray]]:
    """Return the triangular factors of the training samples with as much noise again in the states, for pairs of noises
    of opposite signs.

    The mean over a pair is free of what is linear in the noise. The list is empty if nothing is known of the noise, or if the log is too long.

    Args:
        log: Log, with the density of the noise of its positions.
        dynamics: Dynamics of the robot.
        measured: Joints whose torques are measured, (n_dof,).
    """
    if not np.any(log.position_noise) or log.training.time.size > _MOST_SAMPLES:
        return []
    rng = np.random.default_rng(0)
    pairs = []
    for _ in range(_N_PAIRS):
        noise = rng.standard_normal(log.training.z.shape)
        both = [_add_noise(log, sign * noise) for sign in (1.0, -1.0)]
        sets = [LoggedSet(one, log, dynamics, "training part", measured) for one in both]
        pairs.append((sets[0].compute_factors(), sets[1].compute_factors()))
    return pairs


def _add_noise(log: MeasuredLog, white: FloatArray) -> MeasuredMotions:
    """Return the training motions with noise that passes the same low-pass and derivatives as the positions.

    Args:
        log: Log.
        white: White noise of unit variance, (n_samples, n_dof).
    """
    motions = log.training
    taps = filters.design_low_pass(log.state_cutoff, log.rate)
    noise = filters.apply_filter(white * np.sqrt(log.position_noise * log.rate / 2), taps)
    speeds = filters.differentiate(noise, log.rate)
    accelerations = filters.differentiate(speeds, log.rate)
    return replace(
        motions,
        z=np.asarray(motions.z) + noise,
        dz=np.asarray(motions.dz) + speeds,
        ddz=np.asarray(motions.ddz) + accelerations,
    )


def hint_at_state_noise(names: Sequence[str], cutoff: float, shifts: FloatArray) -> list[str]:
    """Return a hint if noise of the positions shifts parameters by more than a standard deviation.

    The shift by additional noise is less than the bias by the noise that is there, but of its order.

    Args:
        names: Names of the parameters, (n,).
        cutoff: State cut-off, Hz.
        shifts: Shifts of the parameters in their standard deviations by each pair of additional noises, (n_pairs, n).
    """
    if len(shifts) < _N_PAIRS:
        return []
    mean = np.abs(np.mean(shifts, axis=0))
    errors = np.std(shifts, axis=0, ddof=1) / np.sqrt(len(shifts))
    notable = np.flatnonzero((mean > _NOTABLE) & (mean > _CONSISTENT * errors))
    if not notable.size:
        return []
    worst = sorted(notable.tolist(), key=lambda k: -mean[k])[:_MOST_NAMED]
    now = f"{cutoff:.3g} Hz" if np.isfinite(cutoff) else "none"
    listed = ", ".join(f"{names[k]} by {mean[k]:.2g}" for k in worst)
    return [
        f"Noise of the positions shifts {notable.size} of {len(names)} base parameters by more than a standard deviation "
        f"({listed}). Lower sampling.log.state_cutoff, which is {now}, or record positions more finely."
    ]
