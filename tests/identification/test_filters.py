import numpy as np
import pytest

from paramreduce_cli.identification import filters

RATE = 200.0
TIME = np.arange(0, 20, 1 / RATE)
INNER = slice(400, -400)


def wave(frequency, phase=0.0):
    return np.sin(2 * np.pi * frequency * TIME + phase)[:, None]


@pytest.mark.parametrize(
    ("frequency", "gain"), [(1, 1.0), (5, 1.0), (10, 0.5), (20, 0.0), (60, 0.0)]
)
def test_what_is_below_the_cutoff_passes_unshifted(frequency, gain):
    found = filters.apply_filter(wave(frequency), filters.design_low_pass(10, RATE))
    assert found.shape == (TIME.size, 1)
    assert np.abs(found - gain * wave(frequency))[INNER].max() < 0.01


def test_a_straight_line_stays_one_to_its_ends():
    line = np.column_stack([3 - 2 * TIME, TIME])
    assert np.allclose(
        filters.apply_filter(line, filters.design_low_pass(2, RATE)), line, atol=1e-9
    )


def test_cutoffs_beyond_the_rate_leave_a_signal_as_it_is():
    for cutoff in (0.49 * RATE, np.inf):
        assert np.array_equal(
            filters.apply_filter(wave(3), filters.design_low_pass(cutoff, RATE)), wave(3)
        )


def test_a_filter_longer_than_the_signal():
    short = np.linspace(0, 1, 30)[:, None]
    assert np.allclose(
        filters.apply_filter(short, filters.design_low_pass(0.5, RATE)), short, atol=1e-9
    )


@pytest.mark.parametrize("frequency", [1, 5, 20, 40])
def test_derivatives_of_sines(frequency):
    rate = 2 * np.pi * frequency
    expected = rate * wave(frequency, np.pi / 2)
    found = filters.differentiate(wave(frequency), RATE)
    assert np.abs(found - expected)[INNER].max() < 1e-2 * rate
    if frequency <= 5:
        assert np.abs(found - expected)[INNER].max() < 1e-8 * rate


def test_single_samples_are_those_of_the_whole_signal():
    rng = np.random.default_rng(0)
    x = rng.normal(size=(500, 3))
    taps = filters.design_low_pass(15, RATE)
    whole = filters.apply_filter(x, taps)
    outputs = np.array([60, 61, 97, 200])
    some = filters.filter_samples(x[20:300], 20, taps, outputs)
    assert np.allclose(some, whole[outputs], rtol=0, atol=1e-12)


def test_the_band_of_a_motion_ends_where_noise_begins():
    rng = np.random.default_rng(1)
    x = sum(wave(f, f) / f for f in (0.5, 1, 2, 4)) + 1e-3 * rng.normal(size=(TIME.size, 1))
    frequency, density = filters.estimate_spectrum(x.T, RATE)
    assert 4 < filters.find_motion_band(frequency, density) < 7
