"""Parts of one recording in several files."""

import numpy as np
import pytest

from paramreduce_cli.errors import DataError
from paramreduce_cli.identification.log_joining import align_column, join_logs
from paramreduce_cli.records import RawLog


def part(name, rate, seconds=4.0, start=0.0, **signals):
    t = start + np.arange(0, seconds, 1 / rate)
    return RawLog(name, {"t": t, **{key: function(t) for key, function in signals.items()}}, 2)


def test_the_parts_are_at_the_times_of_the_fastest():
    slow = part("a.csv", 50, start=0.013, q1=np.sin, q2=np.cos)
    fast = part("b.csv", 200, tau1=np.sin)
    joined = join_logs([slow, fast], "t")
    t = joined.columns["t"]
    assert joined.source == "a.csv + b.csv"
    assert np.diff(t) == pytest.approx(1 / 200)
    assert t[0] >= 0.013
    np.testing.assert_allclose(joined.columns["q1"], np.sin(t), atol=1e-6)
    np.testing.assert_array_equal(joined.columns["tau1"], np.sin(t))


def test_one_part_is_as_it_is():
    one = part("a.csv", 50, q1=np.sin)
    assert join_logs([one], "time") is one


def test_what_is_missing_is_missing_between_its_neighbours_too():
    slow = part("a.csv", 50, tau1=np.sin)
    slow.columns["tau1"][100] = np.nan
    joined = join_logs([slow, part("b.csv", 200, q1=np.sin)], "t")
    missing = np.isnan(joined.columns["tau1"])
    t = joined.columns["t"]
    np.testing.assert_array_equal(missing, np.abs(t - 2.0) < 1 / 50 - 1e-9)


def test_gaps_of_a_slower_part_are_gaps():
    slow = part("a.csv", 50, tau1=np.sin)
    kept = (slow.columns["t"] < 1) | (slow.columns["t"] > 2)
    slow = RawLog("a.csv", {name: values[kept] for name, values in slow.columns.items()}, 2)
    t = join_logs([slow, part("b.csv", 200, q1=np.sin)], "t").columns["t"]
    assert np.max(np.diff(t)) == pytest.approx(1.0, abs=0.05)


def test_a_topic_of_a_higher_rate_is_averaged():
    """Noise at 101 Hz would be one of 1 Hz at 100 samples a second."""
    t, often = np.arange(0, 4, 0.01), np.arange(0, 4, 0.001)
    columns = {"/a/time": t, "/a/q1": np.sin(t), "/b/time": often}
    for name, signal in (("slow", np.sin(often)), ("fast", np.sin(2 * np.pi * 101 * often))):
        log = RawLog("bag", columns | {"/b/tau1": signal}, None)
        found = align_column(log, "/b/tau1", "/a/time")
        inner = slice(1, -2)
        expected = np.sin(t) if name == "slow" else 0 * t
        np.testing.assert_allclose(found[inner], expected[inner], atol=0.02)


@pytest.mark.parametrize(
    ("other", "says"),
    [
        (part("b.csv", 50, start=100, tau1=np.sin), "hardly any time in common"),
        (part("b.csv", 50, q1=np.sin), "has a column q1 like another part"),
        (RawLog("b.csv", {"time": np.arange(9.0), "tau1": np.arange(9.0)}, 2), "there is no column t,"),
        (RawLog("b.csv", {"t": np.array([0.0, 2, 1]), "tau1": np.arange(3.0)}, 2),
         "b.csv, line 4, column t: time does not increase"),
    ],
    ids=str,
)  # fmt: skip
def test_parts_that_do_not_belong_together(other, says):
    with pytest.raises(DataError) as caught:
        join_logs([part("a.csv", 50, q1=np.sin), other], "t")
    assert says in str(caught.value)
