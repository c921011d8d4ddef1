"""Uncertainty of torques on other motions, against simulated noise."""

import numpy as np
import pytest
from simulated_logs import RATE, arm, simulated

from paramreduce_cli.identification.estimation import Rows, fit_weighted
from paramreduce_cli.identification.prediction_uncertainty import (
    compute_torque_uncertainty,
    hint_at_undetermined_torques,
)
from paramreduce_cli.multibody.random_states import draw_states

_NOISE = 0.03


def fit_log(log, X, tau, seed):
    """A fit to torques with white noise."""
    size = _NOISE * np.std(tau, axis=0)
    noisy = tau + size * np.random.default_rng(seed).normal(size=tau.shape)
    return fit_weighted(Rows((X,), (noisy,), (log.dz,), (log.ddz,), 1 / RATE, 1.0), size)


def test_it_is_the_spread_of_predictions_over_draws_of_the_noise():
    mechanism, dynamics, base, _ = arm()
    log = simulated(0)
    fits = [fit_log(log, log.X, log.tau, seed) for seed in range(60)]
    deviations, sizes = compute_torque_uncertainty(dynamics, base.columns, fits[0])
    states = draw_states(mechanism, 100, np.random.default_rng(5))
    K = dynamics.compute_regressor(*states)[:, :, base.columns]
    wrong = np.array([K @ (fit.parameters - log.values) for fit in fits])
    spread = np.sqrt(np.mean(wrong**2, axis=(0, 1)))
    assert np.all(np.abs(deviations / spread - 1) < 0.3)
    true = np.sqrt(np.mean((K @ log.values) ** 2, axis=0))
    assert np.all(np.abs(sizes / true - 1) < 0.2)


@pytest.mark.parametrize("moving", [0.0, 1e-4])
def test_a_joint_at_rest_is_named(moving):
    _, dynamics, base, values = arm()
    log = simulated(0)
    states = [state.copy() for state in (log.z, log.dz, log.ddz)]
    for state in states:
        state[:, 4] *= moving
    W = dynamics.compute_regressor(*states)
    (hint,) = list_hints(fit_log(log, W[:, :, base.columns], W @ values, 0))
    assert log.names[4] in hint


def test_a_motion_of_all_joints_gives_no_hint():
    log = simulated(0)
    assert not list_hints(fit_log(log, log.X, log.tau, 0))


def list_hints(fit):
    mechanism, dynamics, base, _ = arm()
    found = compute_torque_uncertainty(dynamics, base.columns, fit)
    return list(hint_at_undetermined_torques(*found, np.ones(6, bool), mechanism.coordinate_names))
