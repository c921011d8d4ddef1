import numpy as np
import pytest

from paramreduce_cli.identification.encoder_wraps import unwrap_positions

TIME = np.arange(0, 20, 0.01)


def wrapped(angles):
    return (angles + np.pi) % (2 * np.pi) - np.pi


@pytest.mark.parametrize("size", [0.5, 4.0, 30.0])
def test_positions_are_those_that_were_wrapped(size):
    motion = np.column_stack([size * np.sin(TIME + k) + 0.3 * np.cos(3 * TIME) for k in range(2)])
    z = wrapped(motion)
    jumps = np.count_nonzero(np.abs(np.diff(z, axis=0)) > np.pi, axis=0)
    assert unwrap_positions(z) == tuple(jumps)
    np.testing.assert_allclose(z - z[0], motion - motion[0], atol=1e-12)


def test_noise_at_the_border_of_a_turn():
    noise = 0.01 * np.random.default_rng(0).standard_normal(TIME.size)
    z = wrapped(np.pi + noise)[:, None]
    unwrap_positions(z)
    np.testing.assert_allclose(z[:, 0] - z[0, 0], noise - noise[0], atol=1e-12)


def test_a_motor_that_turns_almost_half_a_turn_a_sample():
    motion = 3.0 * np.arange(200.0) + np.sin(0.1 * np.arange(200))
    z = wrapped(motion)[:, None]
    unwrap_positions(z)
    np.testing.assert_allclose(np.diff(z[:, 0]), np.diff(motion), atol=1e-12)


@pytest.mark.parametrize("step", [3.3, -5.0, 9.0])
def test_steps_that_are_no_turns_are_left(step):
    z = np.where(TIME < 10, 0.0, step)[:, None] + 0.2 * np.sin(TIME)[:, None]
    before = z.copy()
    assert unwrap_positions(z) == (0,)
    np.testing.assert_array_equal(z, before)
