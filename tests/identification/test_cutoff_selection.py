"""Cut-off frequencies of a two-link arm whose noise is known."""

import numpy as np
import pytest
from scipy.signal import butter, sosfilt
from simulated_logs import TWO_LINK, two_link_log

from paramreduce_cli.config import load_config
from paramreduce_cli.config.log_settings import LogSection
from paramreduce_cli.identification.band_scoring import make_column_function
from paramreduce_cli.identification.cutoff_selection import find_motion_frequency
from paramreduce_cli.identification.processing import process_logs
from paramreduce_cli.identification.quality import find_base
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.records import RawLog, RawLogs, Spectra

NAMES = ("upper", "fore")
RATE = 200.0
FRICTION = {"all": {"viscous": "unknown", "coulomb": "unknown", "offset": "unknown"}}


@pytest.fixture(scope="module")
def columns():
    config = load_config(TWO_LINK, [f"drives={FRICTION}"])
    dynamics = Dynamics(config.build_mechanism(), once=True)
    return make_column_function(dynamics, find_base(dynamics, np.ones(2, bool)).columns)


def noisy(position=0.0, torque=0.02, cutoff=None, seconds=20.0, seed=0):
    """A log without speeds, with noise that a controller may have low-passed."""
    log = two_link_log(seconds=seconds, rate=RATE, noise=0.0, seed=seed)
    rng = np.random.default_rng(seed)
    for name, size in (("q", position), ("tau", torque)):
        for j in (1, 2):
            noise = rng.normal(size=log["t"].size)
            if cutoff is not None and name == "q":
                noise = sosfilt(butter(4, cutoff, fs=RATE, output="sos"), noise)
            log[f"{name}{j}"] = log[f"{name}{j}"] + size * noise
            log.pop(f"dq{j}", None)
    return log


def processed(log, columns, **keys):
    logs = RawLogs((RawLog("log.csv", log, 2),), ())
    section = LogSection(files=["log.csv"], **keys)
    return process_logs(logs, section, NAMES, compute_columns=columns)


def compute_accelerations_error(log):
    """Relative error of the accelerations of the used samples, against the same log without noise."""
    truth = processed(noisy(torque=0.0), None, state_cutoff="none", torque_cutoff="none").training
    own = log.training
    used = own.fold >= 0
    rows = np.searchsorted(truth.time, own.time[used] - 1e-6)
    return np.linalg.norm(own.ddz[used] - truth.ddz[rows]) / np.linalg.norm(truth.ddz[rows])


def test_noisy_positions_get_a_low_cutoff(columns):
    clean, rough = (processed(noisy(position=size), columns) for size in (0.0, 2e-3))
    assert rough.state_cutoff < 5 < clean.search.states[-1]
    chosen = compute_accelerations_error(rough)
    others = [
        compute_accelerations_error(processed(noisy(position=2e-3), columns, state_cutoff=cutoff))
        for cutoff in (1.5, 3, 6, 12, 24)
    ]
    assert chosen < 0.1 * others[2]
    assert chosen < 2.5 * min(others)


def test_a_noise_floor_that_a_controller_lowered_is_not_taken_for_the_noise(columns):
    """The noise of positions ends at 30 Hz, so that speeds stand out of the noise floor of all higher frequencies."""
    log = noisy(position=2e-3, cutoff=30.0)
    by_spectrum, by_model = processed(log, None), processed(log, columns)
    assert by_spectrum.state_cutoff > 25
    assert by_model.state_cutoff < 10


def test_torques_are_scored_up_to_where_their_noise_begins(columns):
    quiet, loud = (processed(noisy(torque=size), columns).search for size in (0.01, 1.0))
    assert loud.scored < quiet.scored
    assert loud.unexplained[loud.bands > 2 * loud.scored].min() > 0.5
    assert quiet.unexplained[0] < 0.05


def test_given_cutoffs_stay(columns):
    found = processed(noisy(), columns, torque_cutoff=7)
    assert found.torque_cutoff == 7 == found.search.torque
    assert 7 in found.search.bands
    assert processed(noisy(), columns, state_cutoff=20).state_cutoff == 20
    assert processed(noisy(), columns, state_cutoff=20, torque_cutoff="none").search is None


def test_nothing_held_out_is_looked_at(columns):
    log = noisy()
    other = {key: values.copy() for key, values in log.items()}
    for key in ("q1", "tau2"):
        other[key][int(0.65 * len(log["t"])) :] += 0.1
    one, two = (processed(each, columns, outliers="keep").search for each in (log, other))
    assert np.array_equal(one.state_errors, two.state_errors)
    assert np.array_equal(one.torque_errors, two.torque_errors)


def test_a_short_log_is_processed_all_the_same(columns):
    assert processed(noisy(seconds=1.5), columns).training.time.size


def test_the_motion_frequency_holds_most_of_the_power():
    frequency = np.linspace(0.1, 50, 500)
    positions = np.where(frequency < 3, 1.0, 0.0)[:, None] + 1e-5
    speeds = positions * frequency[:, None] ** 2
    found = find_motion_frequency(Spectra(frequency, speeds, positions))
    assert found == pytest.approx(3, abs=0.15)
