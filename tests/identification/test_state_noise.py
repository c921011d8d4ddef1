"""Noise of positions that biases parameters, on simulated logs."""

import numpy as np
import pytest
from simulated_logs import RATE, arm, coloured, record_encoder, simulated

from paramreduce_cli.config.log_settings import LogSection
from paramreduce_cli.identification.measured_samples import LoggedSet
from paramreduce_cli.identification.processing import process_logs
from paramreduce_cli.identification.state_noise import hint_at_state_noise, predict_shifts
from paramreduce_cli.multibody.observation import combine_factors

CUTOFFS = {"state_cutoff": 10.0, "torque_cutoff": 17.0}


def process(bits, seed=100, velocity=False):
    """A log of positions from an encoder, processed."""
    log = simulated(seed)
    tau = log.tau + coloured(log.tau.shape, 0.03 * np.std(log.tau, axis=0), 0.0, seed)
    speeds = {f"dq{j}": values for j, values in enumerate(log.dz.T, 1)} if velocity else {}
    section = {"columns": {"velocity": "dq{}"}} if velocity else {}
    section = LogSection(files="log.csv", **CUTOFFS, **section)
    return process_logs(record_encoder(log, tau, bits, speeds), section, log.names)


def predict(log):
    """Shifts of the base parameters by additional noise, in units of what 3 % noise of torques costs."""
    _, dynamics, base, _ = arm()
    columns = np.eye(dynamics.mechanism.n_parameters)[:, base.columns]
    factors = LoggedSet(log.training, log, dynamics, "log.csv").compute_factors()
    shifts = predict_shifts(log, dynamics, columns, factors, np.ones(6))
    X = combine_factors(factors[..., base.columns], np.ones(6))
    return shifts / np.sqrt(np.diag(np.linalg.inv(X.T @ X)))


@pytest.mark.parametrize("bits", [12, 16])
def test_the_noise_of_an_encoder_is_measured(bits):
    """The error of rounding is even within a step, and white."""
    step = 2 * np.pi / 2**bits
    density = step**2 / 12 / (RATE / 2)
    assert np.allclose(process(bits).position_noise, density, rtol=0.25)


def test_nothing_is_known_of_the_noise_of_recorded_speeds():
    log = process(16, velocity=True)
    assert not log.position_noise.any()
    assert len(predict(log)) == 0


def test_a_coarse_encoder_with_a_high_cutoff_is_hinted_at():
    names = [f"p{k}" for k in range(len(arm()[2].columns))]
    shifts = predict(process(12))
    (text,) = hint_at_state_noise(names, 10.0, shifts)
    assert "Noise of the positions shifts" in text
    assert "Lower sampling.log.state_cutoff, which is 10 Hz" in text


def test_a_fine_encoder_gives_no_hint():
    names = [f"p{k}" for k in range(len(arm()[2].columns))]
    assert hint_at_state_noise(names, 10.0, predict(process(19))) == []


def test_shifts_that_noise_makes_by_chance_are_not_hinted_at():
    shifts = np.array([[3.0], [-2.0], [4.0], [1.0]])
    assert hint_at_state_noise(["m"], 10.0, shifts) == []
    assert hint_at_state_noise(["m"], 10.0, np.array([[3.0], [2.8], [3.1], [2.9]]))
