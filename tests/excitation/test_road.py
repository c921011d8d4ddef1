"""Random roads: their spectral density, and what wheels meet of them."""

import numpy as np
import pytest
from scipy.signal import welch
from scipy.special import k1

from paramreduce_cli.excitation.road import ROUGHNESS, draw_road

SPEED, WHEELBASE, WIDTH = 20.0, 3.0, 1.6


@pytest.fixture(scope="module")
def heights():
    """Heights of four wheels along 40 km, in steps of 5 cm: front and rear of the left track, then of the right."""
    road = draw_road(ROUGHNESS["C"], SPEED, [0, WHEELBASE], WIDTH, np.random.default_rng(0))
    distance = np.arange(0, 2e4, 0.05)
    turned = np.exp(1j * np.outer(road.omega / SPEED, distance))
    return distance, (road.waves @ turned).imag


@pytest.mark.parametrize("wheel", range(2))
def test_density_is_that_of_the_class(heights, wheel):
    _, z = heights
    n, density = welch(z[wheel], 20.0, nperseg=2**15)
    for low, high in ((0.02, 0.1), (0.1, 0.5), (0.5, 2.0)):
        band = (n > low) & (n < high)
        expected = np.trapezoid(256e-6 * (n[band] / 0.1) ** -2, n[band])
        assert np.trapezoid(density[band], n[band]) == pytest.approx(expected, rel=0.1)


def test_rear_wheels_meet_the_same_road_later(heights):
    distance, z = heights
    behind = round(WHEELBASE / (distance[1] - distance[0]))
    np.testing.assert_allclose(z[1][behind:], z[0][:-behind], atol=1e-9)


def test_tracks_are_as_alike_as_on_an_isotropic_road():
    """Over many roads; a single one has one phase for each wave."""
    roads = [
        draw_road(1e-4, SPEED, [0], WIDTH, np.random.default_rng(seed)) for seed in range(3000)
    ]
    left, right = np.array([road.waves for road in roads]).transpose(1, 0, 2)
    power = np.mean(np.abs(left) ** 2, axis=0)
    np.testing.assert_allclose(np.mean(np.abs(right) ** 2, axis=0), power, rtol=0.1)
    coherence = np.abs(np.mean(left.conj() * right, axis=0)) / power
    x = roads[0].omega / SPEED * WIDTH
    np.testing.assert_allclose(coherence, x * k1(x), atol=0.07)


def test_derivatives_are_exact():
    road = draw_road(1e-4, SPEED, [0, WHEELBASE], None, np.random.default_rng(1))
    h = 1e-5
    before, now, after = (road(1.3 + k * h) for k in (-1, 0, 1))
    np.testing.assert_allclose((after[0] - before[0]) / (2 * h), now[1], rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose((after[1] - before[1]) / (2 * h), now[2], rtol=1e-4, atol=1e-4)
