"""Point-to-point motions: what they do on the way, and what they keep to."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import config_of, model_of
from hypothesis import given, settings
from hypothesis import strategies as st

from paramreduce_cli.excitation.point_to_point import (
    evaluate_along,
    evaluate_point_to_point,
    find_point_to_point,
    sample_point_to_point_times,
)
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.observation import make_spans
from paramreduce_cli.multibody.quantities import Quantities
from paramreduce_cli.records import PointToPoint

NUMBERS = st.floats(-3, 3)


@settings(max_examples=30, deadline=None)
@given(st.tuples(NUMBERS, NUMBERS), st.tuples(NUMBERS, NUMBERS), st.floats(0.1, 10))
def test_a_motion_is_that_of_least_jerk(start, end, duration):
    motion = PointToPoint(np.array(start), np.array(end), duration)
    time = sample_point_to_point_times(motion, 201)
    z, dz, ddz = evaluate_point_to_point(motion, time)
    np.testing.assert_allclose(z[[0, -1]], [start, end], atol=1e-12)
    np.testing.assert_allclose([dz[0], dz[-1], ddz[0], ddz[-1]], np.zeros((4, 2)), atol=1e-12)
    way = np.abs(motion.end - motion.start)
    # Simpson's rule is exact for the cubic accelerations, and nearly so for the quartic speeds.
    for rate, integral, size in ((dz, z, way), (ddz, dz, way / duration)):
        step = (time[2] - time[0]) / 6 * (rate[:-2:2] + 4 * rate[1:-1:2] + rate[2::2])
        np.testing.assert_allclose(
            np.diff(integral[::2], axis=0), step, atol=1e-9 * (1 + size.max())
        )
    # Where the fifth derivative is constant, no polynomial through the same ends has less jerk [Flash1985].
    fifth = np.diff(z, n=5, axis=0)
    scale = np.abs(fifth).max(initial=1e-300)
    assert np.ptp(fifth, axis=0).max() <= 1e-3 * scale + 1e-11


def found(robot, count=5, seed=0, **limits):
    config, model = config_of(robot), model_of(robot)
    wanted = config.trajectories
    own = replace(wanted.build_limits(model.mechanism.n_dof), **limits)
    rng = np.random.default_rng(seed)
    positions = rng.uniform(0.5 * own.lower + 0.5 * own.middle, 0.5 * own.upper + 0.5 * own.middle, (40, own.lower.size))  # fmt: skip
    constraints = wanted.build_constraints(model.mechanism)
    motions = find_point_to_point(model, own, constraints, 2 * np.pi, positions, count, 200, rng)
    return model, own, constraints, positions, motions


@pytest.mark.parametrize("robot", ["two_link", "puma560"])
def test_motions_are_as_fast_as_the_limits_allow(robot):
    n_dof = model_of(robot).mechanism.n_dof
    _, limits, _, positions, motions = found(robot, acceleration=np.full(n_dof, 4.0))
    assert len(motions) == 5
    for motion in motions:
        assert (positions == motion.start).all(axis=1).any()
        _, dz, ddz = evaluate_point_to_point(motion, sample_point_to_point_times(motion, 2001))
        shares = (np.abs(dz) / limits.velocity).max(), (np.abs(ddz) / limits.acceleration).max()
        assert max(shares) == pytest.approx(1.0, abs=1e-5), (
            "one of them binds, and none is exceeded"
        )


def test_joints_without_limits_of_speed_take_half_a_period():
    unlimited = np.full(2, np.inf)
    *_, motions = found("two_link", velocity=unlimited, acceleration=unlimited)
    assert len(motions) == 5
    assert all(motion.duration == pytest.approx(np.pi) for motion in motions)


def test_motions_take_no_more_torque_or_power_than_there_is():
    free = found("two_link")[-1]
    model, limits, *_, motions = found(
        "two_link", torque=np.array([30.0, 9.0]), power=np.array([20.0, 9.0])
    )
    assert motions
    slower = {motion.duration for motion in motions} - {motion.duration for motion in free}
    assert slower, "the limits bind, so that this test shows something"
    for motion in motions:
        z, dz, ddz = evaluate_point_to_point(motion, sample_point_to_point_times(motion, 2001))
        tau = np.abs(Dynamics(model.mechanism).compute_torques(z, dz, ddz, model.values))
        assert (tau <= 1.001 * limits.torque).all()
        assert (tau * np.abs(dz) <= 1.001 * limits.power).all()


def test_motions_of_loops_keep_to_constraints_and_can_be_sampled():
    config, model = config_of("five_bar"), model_of("five_bar")
    limits = config.trajectories.build_limits(model.mechanism.n_dof)
    constraints = config.trajectories.build_constraints(model.mechanism)
    home = model.mechanism.loops.assembly[list(model.mechanism.independent)]
    rng = np.random.default_rng(1)
    positions = np.clip(home + rng.uniform(-0.6, 0.6, (30, home.size)), limits.lower, limits.upper)
    motions = find_point_to_point(model, limits, constraints, 6, positions, 4, 200, rng)
    assert motions
    coordinates, quantities = Coordinates(model.mechanism), Quantities(model.mechanism, constraints)
    at = evaluate_along(motions, 20, 4)
    for span in make_spans([20] * len(motions)):
        block = at(span)
        assert block.fine_positions.shape == (80, home.size)
        np.testing.assert_allclose(block.fine_positions[::4], block.z, atol=1e-12)
        q = coordinates.compute_positions(block.fine_positions, None)
        assert (quantities.compute_rows(q) <= 1e-9).all()


def test_fewer_motions_are_found_where_straight_lines_are_not_free():
    model = model_of("five_bar")
    config = config_of("five_bar")
    limits = config.trajectories.build_limits(model.mechanism.n_dof)
    far = np.array([limits.lower, limits.upper, [limits.lower[0], limits.upper[1]]]) * 3
    motions = find_point_to_point(
        model,
        limits,
        config.trajectories.build_constraints(model.mechanism),
        6.0,
        far,
        3,
        100,
        np.random.default_rng(0),
    )
    assert motions == ()
