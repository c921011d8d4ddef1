import re
import sys
import weakref

import numpy as np
import pytest
from simulated_logs import two_link_log

from paramreduce_cli.config.log_settings import LogSection
from paramreduce_cli.errors import ConfigError, DataError
from paramreduce_cli.identification.data_split import UNUSED, Piece
from paramreduce_cli.identification.log_signals import Place, find_longest
from paramreduce_cli.identification.processing import process_logs
from paramreduce_cli.identification.signals import Signals
from paramreduce_cli.records import RawLog, RawLogs

NAMES = ("upper", "fore")
COLUMNS = {"velocity": "dq{}"}


def made(log, other=None, **keys):
    logs = RawLogs((RawLog("log.csv", log, 2),), () if other is None else (other,))
    keys.setdefault("columns", COLUMNS)
    return process_logs(logs, LogSection(files=["log.csv"], **keys), NAMES)


def used(motions):
    return motions.time[motions.fold != UNUSED]


def test_the_last_share_is_held_out_and_folds_are_equal_parts_in_time():
    found = made(two_link_log(), folds=4, state_cutoff="none")
    learned, tested = used(found.training), used(found.held_out)
    assert learned.max() < tested.min()
    assert tested.size == pytest.approx(0.4 * (learned.size + tested.size), abs=2)
    sizes = np.bincount(found.training.fold[found.training.fold != UNUSED])
    assert sizes.size == 4
    assert np.ptp(sizes) <= 1


def test_it_tells_how_far_it_is():
    told = []
    logs = RawLogs((RawLog("log.csv", two_link_log(), 2),), ())
    process_logs(logs, LogSection(files=["log.csv"], columns=COLUMNS), NAMES, told.append)
    assert [(p.done, p.total) for p in told] == [(k, 4) for k in range(5)]
    assert all(p.detail for p in told[:-1])


def test_nothing_is_learned_from_what_is_held_out():
    """Another end of the log changes nothing in what is learned from, cut-offs included."""
    one, two = two_link_log(), two_link_log()
    border = int(0.6 * one["t"].size) + 5
    for key in ("q1", "tau2", "dq1"):
        two[key] = two[key].copy()
        two[key][border:] += 0.3 * np.sin(60 * two["t"][border:])
    a, b = made(one), made(two)
    assert (a.state_cutoff, a.torque_cutoff) == (b.state_cutoff, b.torque_cutoff)
    for key in ("time", "z", "dz", "ddz", "tau", "fold"):
        assert np.array_equal(getattr(a.training, key), getattr(b.training, key))
    assert not np.array_equal(a.held_out.tau, b.held_out.tau)


def test_logs_larger_than_memory_are_the_same(monkeypatch):
    """Signals in files are those in memory; no column of what was brought is changed."""
    log = two_link_log()
    log["q1"][50] += 1.0
    keys = {"outliers": "replace", "delay": 0.01, "transmission": [[1, 0.5], [0, 2]]}
    here = made(log, **keys)
    before = {name: column.copy() for name, column in log.items()}
    monkeypatch.setattr(sys.modules["paramreduce_cli.resources.scratch"], "_LARGE", 1)
    there = made(log, **keys)
    for key in ("time", "z", "dz", "ddz", "tau", "piece", "fold"):
        for part in ("training", "held_out"):
            one, two = (getattr(getattr(found, part), key) for found in (here, there))
            np.testing.assert_array_equal(one, two)
    np.testing.assert_array_equal(here.spectra.torque, there.spectra.torque)
    for name, column in before.items():
        np.testing.assert_array_equal(log[name], column)


def test_files_are_read_one_at_a_time():
    """What was read before is forgotten when the next one is opened."""
    opened = []

    class Files:
        def __iter__(self):
            for seed in range(3):
                assert all(log() is None for log in opened)
                log = RawLog(f"{seed}.csv", two_link_log(seed=seed), 2)
                opened.append(weakref.ref(log))
                yielded = [log]
                del log
                yield yielded.pop()

    names = [f"{seed}.csv" for seed in range(3)]
    found = process_logs(RawLogs(Files(), ()), LogSection(files=names, columns=COLUMNS), NAMES)
    assert found.training.piece[-1] == 2
    assert [any(name in step for step in found.steps) for name in names] == [True] * 3


def test_held_out_files():
    other = RawLog("other.csv", two_link_log(seed=1), 2)
    found = made(two_link_log(), other, held_out=["other.csv"], state_cutoff="none")
    assert np.count_nonzero(found.training.fold != UNUSED) > 0.99 * found.training.time.size
    assert any("by file" in step for step in found.steps)


@pytest.mark.parametrize("rate", [100.0, 500.0])
def test_a_file_of_another_rate_is_resampled(rate):
    other = RawLog("other.csv", two_link_log(rate=rate), 2)
    keys = {"held_out": ["other.csv"], "state_cutoff": "none", "torque_cutoff": "none"}
    found = made(two_link_log(noise=0.0), other, **keys)
    usual = made(two_link_log(noise=0.0), RawLog("other.csv", two_link_log(), 2), **keys)
    assert "Resampled to 200 Hz, the rate of the first file." in found.steps
    inner = slice(20, -20)
    one, two = found.held_out, usual.held_out
    assert np.diff(one.time) == pytest.approx(1 / 200)
    at = np.searchsorted(two.time, one.time[inner] - 1e-6)
    assert np.abs(one.z[inner] - two.z[at]).max() < 1e-4
    assert np.abs(one.dz[inner] - two.dz[at]).max() < 1e-2


def test_rows_without_torques_are_not_used():
    log, clean = two_link_log(), two_link_log()
    log["tau2"] = log["tau2"].copy()
    log["tau2"][300:340] = np.nan
    log["tau1"] = log["tau1"].copy()
    log["tau1"][700] = np.nan
    keys = {"state_cutoff": "none", "torque_cutoff": "none", "standstill": "keep"}
    found, usual = made(log, **keys), made(clean, **keys)
    (text,) = [text for text in found.warnings if "torques are missing in 41 of" in text]
    assert "lines 302 to 341, 702" in text
    assert np.isfinite(found.training.tau).all()
    times = used(found.training)
    assert not ((times > log["t"][300] - 1e-9) & (times < log["t"][339] + 1e-9)).any()
    # A single row is no gap: it is interpolated like uneven time.
    assert np.abs(times - log["t"][700]).min() < 1e-6
    assert times.size > 0.9 * used(usual.training).size


def test_standstill_is_cut_but_serves_filters():
    log = two_link_log()
    still = 200
    held = {
        key: np.concatenate([np.full(still, values[0] if key.startswith("q") else 0.0), values])
        for key, values in log.items()
    }
    held["t"] = np.arange(held["q1"].size) / 200.0
    found = made(held, state_cutoff=20, torque_cutoff=8)
    assert used(found.training).min() == pytest.approx(still / 200, abs=0.06)
    assert found.training.time.min() == 0
    assert used(made(held, standstill="keep").training).min() == 0


def test_derivatives_without_recorded_speeds():
    log = {key: values for key, values in two_link_log(noise=0.0).items() if "dq" not in key}
    exact = two_link_log(noise=0.0)
    found = made(log, columns={}, state_cutoff=20)
    m = found.training
    inner = slice(100, -100)
    truth = np.interp(m.time, exact["t"], exact["dq1"])
    assert np.abs(m.dz[inner, 0] - truth[inner]).max() < 1e-3 * np.abs(truth).max()
    slope = np.gradient(exact["dq1"], exact["t"])
    assert (
        np.abs(m.ddz[inner, 0] - np.interp(m.time, exact["t"], slope)[inner]).max()
        < 0.01 * np.abs(slope).max()
    )


def test_single_outliers_are_replaced():
    log, clean = two_link_log(), two_link_log()
    log["tau1"] = log["tau1"].copy()
    log["tau1"][[300, 700, 1500]] += 40
    found, usual = made(log, torque_cutoff="none"), made(clean, torque_cutoff="none")
    (step,) = [step for step in found.steps if "3 outliers" in step]
    assert re.search(r"in the (position|torque) of (upper|fore) \(the first at [\d.]+ s\)", step)
    assert np.abs(found.training.tau - usual.training.tau).max() < 1.5
    kept = made(log, torque_cutoff="none", outliers="keep")
    assert np.abs(kept.training.tau - usual.training.tau).max() > 30


def test_noise_that_varies_is_no_outlier():
    """Ripple in one half of a motion; an outlier in the other half is found all the same."""
    log = two_link_log()
    rng = np.random.default_rng(5)
    half = log["t"].size // 2
    log["tau1"] = log["tau1"].copy()
    log["tau1"][half:] += 2 * rng.choice([-1, 1], log["t"].size - half) * rng.uniform(0.5, 2, log["t"].size - half)  # fmt: skip
    assert not any("outliers" in step for step in made(log).steps)
    log["tau1"][500] += 8
    (step,) = [step for step in made(log).steps if "outliers" in step]
    assert f"1 in the torque of upper (the first at {log['t'][500]:.6g} s)" in step


def test_what_is_shown_is_what_was_done():
    log = two_link_log()
    log["tau1"] = log["tau1"].copy()
    log["tau1"][[300, 700, 2300]] += 40
    found = made(log, torque_cutoff=5, trim=[0.5, 0])
    shown = found.shown
    learned, tested = used(found.training), used(found.held_out)
    assert shown.learned.tolist() == [learned[0], learned[-1]]
    assert shown.held_out.tolist() == [tested[0], tested[-1]]
    assert shown.raw_time[[0, -1]] == pytest.approx(log["t"][[0, -1]], abs=0.01)
    assert [row.tolist() for row in shown.outliers if row[1] == 0] == [
        [1, 0, log["t"][k]] for k in (300, 700, 2300)
    ]
    clean = two_link_log(noise=0)
    truth = np.column_stack(
        [np.interp(shown.time, clean["t"], clean[f"tau{j + 1}"]) for j in range(2)]
    )
    raw = np.column_stack([np.interp(shown.time, shown.raw_time, r) for r in shown.raw_tau.T])
    rough, smooth = (np.median(np.abs(np.diff(t - truth, axis=0))) for t in (raw, shown.tau))
    assert smooth < rough / 5


def test_held_out_files_are_not_shown_after_what_is_learned_from():
    shown = made(two_link_log(seconds=6), RawLog("b.csv", two_link_log(seed=1), 2), held_out=["b.csv"]).shown  # fmt: skip
    assert np.isnan(shown.held_out).all()
    assert shown.raw_time[-1] == pytest.approx(6, abs=0.01)


def test_the_longest_motion_is_shown_with_what_goes_on_from_it():
    def motion(first, size):
        time = first + np.arange(size) / 10
        z = np.zeros((size, 1))
        return Piece(Signals(time, z, z, z, z), time[0], time[-1])

    learned = [[motion(0, 30)], [motion(0, 20), motion(5, 50)]]
    held_out = [[motion(3, 40)], [motion(10, 25), motion(20, 60)]]
    assert find_longest(learned, held_out, 10.0) == Place(file=1, learned=2, held_out=1)
    assert find_longest(learned, [[], [motion(11, 25)]], 10.0).held_out is None
    assert find_longest(learned, [], 10.0).held_out is None
    assert find_longest([[motion(0, 60), motion(9, 5)]], [[motion(6, 5)]], 10.0).held_out is None


def test_steps_of_friction_are_no_outliers():
    assert not any("outliers" in step for step in made(two_link_log()).steps)


def test_a_delay_is_taken_back():
    log = two_link_log(noise=0.0)
    late = log | {f"tau{j}": np.interp(log["t"] - 0.02, log["t"], log[f"tau{j}"]) for j in (1, 2)}
    found, usual = made(late, delay=0.02, torque_cutoff="none"), made(log, torque_cutoff="none")
    error = np.abs(found.training.tau - usual.training.tau)[20:-20]
    assert np.median(error) < 1e-6


def test_what_is_cut_off_whole_is_said():
    with pytest.raises(DataError, match=r"log\.csv: too few samples.*sampling\.log\.trim"):
        made(two_link_log(), trim=[100, 0])


def test_a_cutoff_above_half_the_rate_is_refused():
    with pytest.raises(ConfigError, match=r"is 150 Hz, but the log is recorded at 200 Hz"):
        made(two_link_log(), state_cutoff=150)


def test_noise_is_what_lies_above_the_band():
    found = made(two_link_log(noise=0.5), state_cutoff=10, torque_cutoff=10)
    # White noise of which a tenth of the band passes the low-pass.
    assert found.noise == pytest.approx([0.5 * np.sqrt(0.9)] * 2, rel=0.15)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda log: log | {"q1": np.degrees(log["q1"]) * 1, "dq1": log["dq1"]}, "degrees"),
        (lambda log: log | {"dq2": -log["dq2"]}, "fore has the other sign"),
        (lambda log: log | {"dq1": log["dq2"], "dq2": log["dq1"]}, "columns swapped"),
        (lambda log: log | {"dq1": np.degrees(log["dq1"])}, "is the speed in degrees"),
        (lambda log: log | {"dq1": np.full_like(log["t"], 0.2)}, "recorded speeds are constant"),
        (
            lambda log: log | lag_speeds(log, 0.004),
            "recorded speeds lag the positions by about 4 ms",
        ),
        (lambda log: log | {"tau1": np.clip(log["tau1"], -5, 5)}, "at a limit"),
        (lambda log: log | {"tau2": np.zeros_like(log["t"])}, "are constant"),
        (
            lambda log: log | {"q2": np.zeros_like(log["t"]), "dq2": np.zeros_like(log["t"])},
            "never moves",
        ),
    ],
)
def test_warnings(change, said):
    assert any(said in text for text in made(change(two_link_log())).warnings)


def lag_speeds(log, lag):
    """Speeds that come later by some seconds."""
    return {name: np.interp(log["t"] - lag, log["t"], log[name]) for name in ("dq1", "dq2")}


@pytest.mark.parametrize("change", [{}, {"dq2": 0.004}])
def test_no_warnings_of_a_good_log(change):
    """One lag alone is no low-pass of all speeds."""
    log = two_link_log()
    late = {name: lag_speeds(log, lag)[name] for name, lag in change.items()}
    assert made(log | late).warnings == ()
