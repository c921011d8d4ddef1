import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paramreduce_cli.errors import DataError
from paramreduce_cli.identification.position_jumps import find_position_jumps, name_rows
from paramreduce_cli.identification.signals import Signals


def recording(rate=100.0, duration=20.0, speeds=True, size=1.0):
    """Two joints in motion, with the noise of an encoder."""
    time = np.arange(0, duration, 1 / rate)
    random = np.random.default_rng(0)
    phase = np.array([0.0, 1.3])
    z = size * (np.sin(1.7 * time[:, None] + phase) + 0.3 * np.cos(4.1 * time[:, None]))
    dz = size * (1.7 * np.cos(1.7 * time[:, None] + phase) - 1.23 * np.sin(4.1 * time[:, None]))
    z += 1e-5 * random.standard_normal(z.shape)
    tau = 5 * np.sin(2 * time[:, None] + phase) + 0.1 * random.standard_normal(z.shape)
    return Signals(time, z, dz if speeds else None, None, tau)


def with_rows(found, rows, value=0.0):
    """Rows in which all signals have one value."""
    for part in (found.z, found.dz, found.tau):
        if part is not None:
            part[rows] = value
    return found


@pytest.mark.parametrize("speeds", [True, False])
@pytest.mark.parametrize("rate", [30.0, 100.0, 1000.0])
@pytest.mark.parametrize("value", [0.0, 2.5])
def test_dropouts_are_found(speeds, rate, value):
    found = recording(rate, speeds=speeds)
    bad = np.zeros(found.time.size, bool)
    for start, length in ((50, 4), (133, 1), (250, 7), (420, 15), (500, 2)):
        bad[start : start + length] = True
    jumps = find_position_jumps(with_rows(found, bad, value))
    np.testing.assert_array_equal(jumps.bad, bad)
    assert not jumps.steps.size


def test_a_long_dropout_is_found():
    found = recording()
    bad = np.zeros(found.time.size, bool)
    bad[700:1000] = True
    jumps = find_position_jumps(with_rows(found, bad, 4.0))
    np.testing.assert_array_equal(jumps.bad, bad)


@pytest.mark.parametrize("every", [3, 4, 7])
@pytest.mark.parametrize("value", [0.0, -1.7])
def test_rows_of_a_second_publisher_are_found(every, value):
    found = recording()
    bad = np.arange(found.time.size) % every == 1
    jumps = find_position_jumps(with_rows(found, bad, value))
    np.testing.assert_array_equal(jumps.bad, bad)


def test_where_half_of_the_rows_are_of_another_robot_they_are_refused():
    found = recording()
    found.z[::2] = 3 + np.sin(3 * found.time[::2, None])
    with pytest.raises(DataError, match="of 2000 rows"):
        find_position_jumps(found)


@pytest.mark.parametrize("step", [0.4, -2.0])
def test_a_step_that_stays_parts_the_recording(step):
    found = recording()
    found.z[1234:, 1] += step
    jumps = find_position_jumps(found)
    assert not jumps.bad.any()
    assert jumps.steps.tolist() == [1234]


def test_motions_one_after_the_other_are_parted():
    one, other = recording(duration=5), recording(duration=12)
    time = np.concatenate([one.time, 5 + other.time])
    z, dz, tau = (
        np.concatenate([getattr(one, key), getattr(other, key) + 0.0]) for key in ("z", "dz", "tau")
    )
    jumps = find_position_jumps(Signals(time, z, dz, None, tau))
    assert not jumps.bad.any()
    assert jumps.steps.tolist() == [500]


@settings(max_examples=40, deadline=None)
@given(
    rate=st.sampled_from([20.0, 100.0, 1000.0]),
    rests=st.floats(0.0, 0.98),
    quantum=st.sampled_from([0.0, 1e-4, 1e-2]),
    noise=st.sampled_from([0.0, 1e-6, 2e-3]),
    speeds=st.booleans(),
    seed=st.integers(0, 2**32 - 1),
)
def test_nothing_is_found_in_what_robots_do(rate, rests, quantum, noise, speeds, seed):
    """Point to point with rests: the fastest part may be short, and positions come in steps and with noise."""
    random = np.random.default_rng(seed)
    time = np.arange(0, 20, 1 / rate)
    z, dz = np.zeros((time.size, 2)), np.zeros((time.size, 2))
    duration = max(0.4, 2 * (1 - rests))
    for j in range(2):
        at = 0.0
        for start in np.arange(0.2 * j, 20, 2.0):
            goal = random.uniform(-1.5, 1.5)
            s = np.clip((time - start) / duration, 0, 1)
            z[:, j] += (goal - at) * (10 * s**3 - 15 * s**4 + 6 * s**5)
            dz[:, j] += (goal - at) / duration * 30 * s**2 * (1 - s) ** 2
            at = goal
    z += noise * random.standard_normal(z.shape)
    z = np.round(z / quantum) * quantum if quantum else z
    jumps = find_position_jumps(Signals(time, z, dz if speeds else None, None, np.sin(z)))
    assert not jumps.bad.any()
    assert not jumps.steps.size


def test_rows_are_named():
    rows = np.array([3, 4, 5, 9, 20, 21, 30, 40])
    assert name_rows(rows, None) == "rows 4 to 6, 10, 21 to 22, 31 and 1 more"
    assert name_rows(rows[:4], 2) == "lines 5 to 7, 11"
