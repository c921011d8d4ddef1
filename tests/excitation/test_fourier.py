import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paramreduce_cli.excitation.fourier import (
    compute_grid_margin,
    evaluate_basis,
    sample_times,
    shift_start,
)


def series(coefficients, period, t):
    """The formula of the artifact's documentation, literally."""
    w = 2 * np.pi / period
    z = np.full_like(t, coefficients[0])
    for k in range((len(coefficients) - 1) // 2):
        a, b, n = coefficients[1 + 2 * k], coefficients[2 + 2 * k], k + 1
        z += a / (w * n) * np.sin(w * n * t) - b / (w * n) * np.cos(w * n * t)
    return z


def test_series_and_its_derivatives():
    rng = np.random.default_rng(0)
    coefficients = rng.normal(size=(2, 7))
    t = np.linspace(0.1, 3, 11)
    z, dz, ddz = evaluate_basis(5.0, 3, t).evaluate(coefficients)
    step = 1e-5
    for j in range(2):
        before, here, after = (series(coefficients[j], 5.0, t + d) for d in (-step, 0, step))
        assert np.allclose(z[:, j], here, atol=1e-14)
        assert np.allclose(dz[:, j], (after - before) / (2 * step), atol=1e-8)
        assert np.allclose(ddz[:, j], (after - 2 * here + before) / step**2, atol=1e-4)


@settings(max_examples=50, deadline=None)
@given(st.integers(1, 6), st.integers(0, 1000), st.integers(1, 40))
def test_no_series_exceeds_its_grid_by_more_than_the_margin(harmonics, seed, extra):
    points = 2 * harmonics + extra
    coefficients = np.random.default_rng(seed).normal(size=(1, 1 + 2 * harmonics))
    coarse = evaluate_basis(1.0, harmonics, sample_times(1.0, points))
    fine = evaluate_basis(1.0, harmonics, sample_times(1.0, 4001))
    for on_grid, between in zip(
        coarse.evaluate(coefficients), fine.evaluate(coefficients), strict=True
    ):
        bound = np.abs(on_grid).max() / compute_grid_margin(harmonics, points)
        assert np.abs(between).max() <= bound * (1 + 1e-9)


def test_a_grid_too_coarse_for_the_harmonics_is_refused():
    with pytest.raises(ValueError, match="8 points"):
        compute_grid_margin(4, 8)


@pytest.mark.parametrize("time", [0.0, 0.3, 2.9, 400.1])
def test_a_motion_can_begin_later(time):
    rng = np.random.default_rng(0)
    coefficients, times = rng.normal(size=(3, 9)), np.linspace(0, 1, 7)
    later = evaluate_basis(2.0, 4, time + times).evaluate(coefficients)
    moved = evaluate_basis(2.0, 4, times).evaluate(shift_start(coefficients, 2.0, time))
    for one, other in zip(moved, later, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-9 if time > 100 else 1e-12)
