"""Zeros, directions and order of joints on torques of the Panda whose truth is known."""

import numpy as np
import pytest
from conftest import config_of

from paramreduce_cli.identification.joint_hypotheses import hint_at_joint_frames
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.random_states import draw_states

NAMES = tuple("abcdefg")


@pytest.fixture(scope="module")
def panda():
    config = config_of("panda")
    return Dynamics(config.build_mechanism()), config.get_values()


def recorded(panda, offsets=0.0, signs=1.0, order=(0, 1, 2, 3, 4, 5, 6), noise=0.02, seed=0):
    """States and torques as a log has them whose joints are related to the model's in this way."""
    dynamics, values = panda
    z, dz, ddz = draw_states(dynamics.mechanism, 250, np.random.default_rng(seed))
    tau = dynamics.compute_regressor(z, dz, ddz) @ values
    size = noise * np.linalg.norm(tau) / np.sqrt(tau.size)
    tau += size * np.random.default_rng(seed).normal(size=tau.shape)
    inverse = np.argsort(order)
    states = [
        (signs * (z - offsets))[:, inverse],
        (signs * dz)[:, inverse],
        (signs * ddz)[:, inverse],
    ]
    return states, (signs * tau)[:, inverse]


def hints(panda, **keys):
    states, tau = recorded(panda, **keys)
    return list(hint_at_joint_frames(panda[0], states, tau, np.ones(7, bool), NAMES))


def test_a_right_log_gives_no_hint(panda):
    assert hints(panda) == []
    assert hints(panda, noise=0.5) == []


@pytest.mark.parametrize("noise", [0.02, 0.1])
def test_zeros_of_two_joints(panda, noise):
    (text,) = hints(panda, offsets=np.array([0, -np.pi / 2, 0, np.pi / 2, 0, 0, 0]), noise=noise)
    assert "offsets: [0, -pi/2, 0, pi/2, 0, 0, 0]" in text


def test_a_direction(panda):
    (text,) = hints(panda, signs=np.array([1, 1, 1, -1, 1, 1, 1]))
    assert "signs: [1, 1, 1, -1, 1, 1, 1]" in text


def test_an_exchange(panda):
    (text,) = hints(panda, order=(0, 3, 2, 1, 4, 5, 6))
    assert "the columns of d for b" in text
    assert "the columns of b for d" in text
