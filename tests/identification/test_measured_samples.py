import numpy as np
import pytest
from simulated_logs import two_link_log

from paramreduce_cli.artifacts import hdf5, layouts
from paramreduce_cli.artifacts.store import Store, load_file
from paramreduce_cli.config import load_config
from paramreduce_cli.config.log_settings import LogSection
from paramreduce_cli.identification import measured_samples
from paramreduce_cli.identification.data_split import UNUSED
from paramreduce_cli.identification.measured_samples import LoggedSet
from paramreduce_cli.identification.processing import process_logs
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.observation import combine_factors
from paramreduce_cli.records import MeasuredLog, Model, RawLog, RawLogs


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    from simulated_logs import log_config

    return Dynamics(
        load_config(log_config(tmp_path_factory.mktemp("arm"))).build_mechanism(), once=True
    )


def made(log, **keys):
    section = LogSection(files=["log.csv"], columns={"velocity": "dq{}"}, **keys)
    logs = RawLogs((RawLog("log.csv", log, 2),), ())
    return process_logs(logs, section, ("upper", "fore"))


def gathered(sample_set):
    blocks = list(sample_set.iterate_blocks())
    keys = ("time", "z", "dz", "ddz", "tau", "W")
    whole = {key: np.concatenate([getattr(b, key) for b in blocks]) for key in keys}
    return whole, np.concatenate([[b.trajectory] * b.time.size for b in blocks])


def test_torques_and_columns_pass_the_same_filter(arm):
    """What a textbook does: filter the whole signals, then take every so many samples."""
    log = made(two_link_log(), state_cutoff=20, torque_cutoff=5)
    found, fold = gathered(LoggedSet(log.training, log, arm, "x"))
    m = log.training
    K = arm.compute_regressor(m.z, m.dz, m.ddz)
    from paramreduce_cli.identification import filters

    taps = filters.design_low_pass(5, log.rate)
    rows = np.searchsorted(m.time, found["time"])
    tau = np.column_stack([np.convolve(t, taps, "same") for t in m.tau.T])
    W = np.apply_along_axis(np.convolve, 0, K.reshape(m.time.size, -1), taps, "same")
    assert np.allclose(found["tau"], tau[rows], rtol=0, atol=1e-10)
    assert np.allclose(found["W"].reshape(rows.size, -1), W[rows], rtol=0, atol=1e-9)
    assert np.array_equal(fold, m.fold[rows])
    assert np.diff(found["time"]).min() == pytest.approx(1 / log.output_rate)


def read(folder, record):
    return load_file(Store(folder).get_path(record), record, None, "")[0]


def test_motions_that_are_read_by_rows_are_those_in_memory(measured_results, monkeypatch):
    """Whatever is read together, and wherever folds begin."""
    folder = measured_results / "results"
    log, model = (read(folder, kind) for kind in (MeasuredLog, Model))
    monkeypatch.setattr(layouts, "_LARGE", 0)
    monkeypatch.setattr(hdf5, "_STRETCH", 5000)
    monkeypatch.setattr(measured_samples, "_LOOKED_AT", 77)
    stored = read(folder, MeasuredLog)
    assert not isinstance(stored.training.z, np.ndarray)
    assert np.array_equal(np.asarray(stored.held_out.tau), log.held_out.tau)
    dynamics = Dynamics(model.mechanism)
    for one, other in ((log.training, stored.training), (log.held_out, stored.held_out)):
        sets = [LoggedSet(motions, log, dynamics, "x") for motions in (one, other)]
        assert sets[0].n_samples == sets[1].n_samples > 50
        assert np.array_equal(sets[0].compute_factors(), sets[1].compute_factors())
        for a, b in zip(*(found.iterate_states() for found in sets), strict=True):
            assert np.array_equal(a.tau, b.tau)
            assert np.array_equal(a.ddz, b.ddz)


@pytest.mark.parametrize("cutoff", ["none", 5])
def test_an_exact_model_stays_exact(arm, cutoff):
    """Friction with steps too, as its columns pass the same filter."""
    log = made(two_link_log(noise=0.0), state_cutoff="none", torque_cutoff=cutoff, outliers="keep")
    found = LoggedSet(log.training, log, arm, "x")
    factor = combine_factors(found.compute_factors(), None)
    left = np.linalg.lstsq(factor[:, :-1], factor[:, -1], rcond=None)[0]
    error = np.linalg.norm(factor[:, -1] - factor[:, :-1] @ left) / np.linalg.norm(factor[:, -1])
    assert error < 2e-4  # differentiated speeds are the only error


def test_samples_have_all_the_neighbours_that_the_filter_needs(arm):
    log = made(two_link_log(), torque_cutoff=5)
    for motions in (log.training, log.held_out):
        sample_set = LoggedSet(motions, log, arm, "x")
        found, _ = gathered(sample_set)
        assert found["time"].size == sample_set.n_samples
        used = motions.time[motions.fold != UNUSED]
        assert found["time"].min() > used.min() + 0.1
        assert found["time"].max() < used.max() - 0.1
