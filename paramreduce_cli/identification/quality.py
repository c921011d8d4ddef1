"""Quality of a log: the parameters that its motion determines."""

from dataclasses import dataclass

import numpy as np

from paramreduce_cli.identification.data_split import UNUSED
from paramreduce_cli.identification.measured_samples import LoggedSet
from paramreduce_cli.multibody.base_parameters import choose_base, find_affecting_parameters
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.observation import combine_factors
from paramreduce_cli.multibody.random_states import draw_states
from paramreduce_cli.records import BaseParameters, BoolArray, FloatArray, MeasuredLog

_STATES = 200
"""Random states on which the base parameters are found."""
_RANK_TOLERANCE = 1e-9
_TELLING = 0.02
"""Share of a column's length that the others must leave for its parameter to be told from them."""
_DEPENDENT = 1e-6


@dataclass(frozen=True)
class LogQuality:
    """A measure of how well a log excites a robot."""

    n_base: int
    """Base parameters that motions can tell."""
    rank: int
    """Number of base parameters that the log determines, noise apart."""
    condition: float
    """Condition number of the observation matrix of the base parameters with columns of unit length."""
    weak: tuple[str, ...]
    """Base parameters that can hardly be told from the others."""


def find_base(dynamics: Dynamics, measured: BoolArray) -> BaseParameters:
    """Return the base parameters that the measured torques of random states tell.

    Args:
        dynamics: Dynamics of the robot.
        measured: Coordinates whose torques are measured, (n_dof,).
    """
    mechanism = dynamics.mechanism
    states = draw_states(mechanism, _STATES, np.random.default_rng(0))
    K = dynamics.compute_regressor(*states)[:, measured]
    affects = find_affecting_parameters(mechanism, K)
    return choose_base(
        K.reshape(-1, K.shape[2]), mechanism.preference_order, _RANK_TOLERANCE, affects
    )


def measure_quality(dynamics: Dynamics, base: BaseParameters, log: MeasuredLog) -> LogQuality:
    """Return how well the training part of a log excites a robot's base parameters.

    Args:
        dynamics: Dynamics of the robot.
        base: Base parameters of the robot.
        log: Processed log.
    """
    factors = LoggedSet(log.training, log, dynamics, "training part").compute_factors()
    scale = np.sqrt(np.sum(factors[..., -1] ** 2, axis=(0, 2)))
    scale = np.where(scale > 0, scale, np.inf)
    W = combine_factors(factors, scale)[:, base.columns]
    lengths = np.linalg.norm(W, axis=0)
    X = W / np.where(lengths > 0, lengths, 1.0)
    sizes = np.linalg.svd(X, compute_uv=False)
    rank = int(np.sum(sizes > _DEPENDENT * sizes[0]))
    names = [dynamics.mechanism.parameter_names[k] for k in base.columns]
    left = _compute_independent_fractions(X, lengths)
    order = np.argsort(left)
    return LogQuality(
        n_base=base.columns.size,
        rank=rank,
        condition=float(sizes[0] / sizes[-1]) if rank == sizes.size else np.inf,
        weak=tuple(names[k] for k in order if left[k] < _TELLING),
    )


def _compute_independent_fractions(X: FloatArray, lengths: FloatArray) -> FloatArray:
    """Return the fraction of each column's length that the other columns do not explain, (n,)."""
    inverse = np.linalg.pinv(X.T @ X, rcond=_DEPENDENT**2, hermitian=True)
    diagonal = np.diag(inverse)
    hidden = 1 - np.diag(inverse @ (X.T @ X))  # columns that others make up altogether
    shares = np.where(diagonal > 0, 1 / np.sqrt(np.maximum(diagonal, 1e-300)), 0.0)
    return np.where((lengths > 0) & (np.abs(hidden) < 1e-3), np.minimum(shares, 1.0), 0.0)


def estimate_noise_floor(log: MeasuredLog, nominal: FloatArray) -> float:
    """Return the torque error that noise alone causes; its density within the model's band is assumed to be that above.

    Args:
        log: Processed log.
        nominal: Torques that errors of joints are divided by, infinite where none is measured, (n_dof,).

    Returns:
        A share of the torques that are learned from, each joint's divided by the nominal ones; zero where all frequencies are in
        the band, so that nothing tells of noise.
    """
    half = log.rate / 2
    cutoff = min(log.torque_cutoff, half)
    above = half - (cutoff if np.isfinite(log.torque_cutoff) else min(log.state_cutoff, half))
    if above <= 0:
        return 0.0
    used = log.training.fold != UNUSED
    power = np.array([np.mean(tau[used] ** 2) for tau in log.training.tau.T])
    noise = log.noise**2 * cutoff / above
    return float(np.sqrt(np.nansum(noise / nominal**2) / np.nansum(power / nominal**2)))
