"""Torques in another unit, and gravity along another axis, on simulated logs."""

import re
from dataclasses import replace

import numpy as np
import pytest
from simulated_logs import along_axes, arm, coloured, simulated

from paramreduce_cli.identification.torque_hints import (
    hint_at_gravity,
    hint_at_rating,
    hint_at_sign,
    hint_at_unit,
)
from paramreduce_cli.multibody.dynamics import Dynamics

SEEDS = range(10)
EVERY = 10
"""Of the samples."""


def torques(gravity, seed):
    """With gravity along some direction, by columns of the arm as it stands, and what gravity adds to these."""
    mechanism, _, _, values = arm()
    log = simulated(seed)
    states = [s[::EVERY] for s in (log.z, log.dz, log.ddz)]
    W, pulls = along_axes(*states)
    true = (
        Dynamics(replace(mechanism, gravity=np.array(gravity))).compute_regressor(*states) @ values
    )
    noise = 0.03 * np.std(true, axis=0)
    tau = true + coloured(true.shape, noise, 0.9, seed)
    return W, pulls, tau, noise


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(
    ("gravity", "said"),
    [((0, 0, -9.81), None), ((0, 0, 0), "Without gravity"), ((0, -9.81, 0), "-y"), ((9.81, 0, 0), "along x"), ((0, 0, 9.81), "along z")],
)  # fmt: skip
def test_the_axis_of_gravity_is_found(gravity, said, seed):
    W, pulls, tau, noise = torques(gravity, seed)
    found = hint_at_gravity(W, pulls, tau, noise, np.array([0, 0, -9.81]))
    assert len(found) == (said is not None)
    assert said is None or said in found[0]


@pytest.mark.parametrize("factor", [1000, 1 / 9.81, 0.02, 1.3, 0.7, -1])
def test_a_factor_of_all_torques_is_found(factor):
    _, dynamics, _, values = arm()
    log = simulated(0)
    W = dynamics.compute_regressor(log.z, log.dz, log.ddz)
    rng = np.random.default_rng(0)
    # What was identified is not quite what the config says.
    found = hint_at_unit(W @ values, W @ (factor * values * rng.uniform(0.8, 1.2, values.size)))
    if 0.5 < factor < 2:
        assert not found
    elif factor < 0:
        assert "opposite" in found[0]
    else:
        told = float(found[0].split("Torques are ")[1].split(" times")[0])
        assert told == pytest.approx(factor, rel=0.2)


def test_unknown_values_let_nothing_expect():
    found = np.random.default_rng(0).normal(size=(50, 3))
    assert not hint_at_unit(np.zeros((50, 3)), found)
    assert not hint_at_unit(np.random.default_rng(1).normal(size=(50, 3)), 100 * found)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("torques", ["and torques", "but not torques"])
@pytest.mark.parametrize("joint", [None, 0, 2, 4])
def test_a_joint_that_counts_the_other_way_is_found(joint, torques, seed):
    """Recorded motions of one joint turned round, with its torques or without."""
    _, dynamics, _, _ = arm()
    log = simulated(seed)
    names = log.names
    states = [s[::EVERY].copy() for s in (log.z, log.dz, log.ddz)]
    noise = 0.03 * np.std(log.tau, axis=0)
    tau = (log.tau + coloured(log.tau.shape, noise, 0.9, seed))[::EVERY]
    if joint is not None:
        for values in states:
            values[:, joint] *= -1
        tau[:, joint] *= -1 if torques == "and torques" else 1

    def mirrored():
        for j in range(len(names)):
            sign = np.ones(len(names))
            sign[j] = -1
            yield dynamics.compute_regressor(*(sign * values for values in states))

    found = hint_at_sign(dynamics.compute_regressor(*states), mirrored(), tau, noise, names)
    assert len(found) == (joint is not None)
    assert joint is None or re.search(rf"speeds of {names[joint]} counted .*, {torques}", found[0])


@pytest.mark.parametrize(
    ("factor", "said"), [(1.0, ""), (2.5, ""), (1000.0, "b"), (0.005, "a")], ids=str
)
def test_torques_far_from_what_joints_are_rated_for_are_doubted(factor, said):
    tau = factor * np.array([[0.5, -0.2], [-0.3, 0.3]]) * np.array([330.0, 56.0])
    rating = np.array([330.0, 56.0]) * np.array([1.0, 0.5] if said == "b" else [1.0, 1.0])
    found = hint_at_rating(tau, rating, ("a", "b"))
    assert (f", of {said}, goes up to" in found[0]) if said else not found
