"""Random states inside limits and constraints."""

import numpy as np
import pytest
from conftest import config_of, model_of

from paramreduce_cli.multibody.kinematics import compute_body_poses
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.quantities import Quantities
from paramreduce_cli.multibody.states_inside import StatesInside
from paramreduce_cli.records import Constraint

BOUNDS = np.array([[-1.0, -0.5], [-3.0, -2.0], [-4.0, -5.0]]), np.array([[1.5, 0.5], [3.0, 2.0], [4.0, 6.0]])  # fmt: skip


def drawn(robot, bounds, constraints=(), known=None, count=500, **more):
    mechanism = model_of(robot).mechanism
    known = np.zeros((1, mechanism.n_q)) if known is None else known
    inside = StatesInside(mechanism, *bounds, constraints, known)
    return mechanism, inside.draw(count, np.random.default_rng(0), **more)


def test_coordinates_are_anywhere_inside_their_limits():
    _, states = drawn("two_link", BOUNDS, count=4000)
    for values, lower, upper in zip(states, *BOUNDS, strict=True):
        assert values.shape == (4000, 2)
        assert np.all((values >= lower) & (values <= upper))
        np.testing.assert_allclose(values.mean(axis=0), (lower + upper) / 2, atol=0.2)
        np.testing.assert_allclose(values.std(axis=0), (upper - lower) / np.sqrt(12), rtol=0.05)
    every = np.hstack(states)
    correlations = np.corrcoef(every.T) - np.eye(6)
    assert np.abs(correlations).max() < 0.06, "each is drawn by itself"


def test_corners():
    _, states = drawn("two_link", BOUNDS, corners=True)
    for values, lower, upper in zip(states, *BOUNDS, strict=True):
        assert np.all((values == lower) | (values == upper))
        assert np.all((values == lower).any(axis=0) & (values == upper).any(axis=0))


def test_constraints_are_kept_to_and_may_leave_nothing():
    nothing = np.zeros(3)
    for upper in (0.35, 1e-9):
        near = Constraint("near", "distance-from-axis", (1, -1), (np.array([0.3, 0, 0]), nothing, np.array([1.0, 0, 0])), -np.inf, upper)  # fmt: skip
        mechanism, (q, dq, ddq) = drawn("two_link", BOUNDS, [near])
        assert len(q) == len(dq) == len(ddq)
        if upper < 1e-6:
            assert len(q) == 0
            continue
        assert len(q) == 500, "as many as were asked for, though most are refused"
        tip = np.array([(compute_body_poses(mechanism, one)[1] @ [0.3, 0, 0, 1])[:3] for one in q])
        assert np.hypot(tip[:, 1], tip[:, 2]).max() <= upper + 1e-9


@pytest.mark.parametrize("robot", ["four_bar", "five_bar", "delta"])
def test_states_of_loops_are_assembled_inside_limits_and_constraints(robot):
    config = config_of(robot)
    mechanism = model_of(robot).mechanism
    coordinates, independent = Coordinates(mechanism), list(mechanism.independent)
    assembly = mechanism.loops.assembly
    rng = np.random.default_rng(1)
    wanted = assembly[independent] + rng.uniform(-0.1, 0.1, (20, len(independent)))
    reached, way = coordinates.follow(wanted, assembly)
    known = np.vstack([assembly, reached[way == 1]])
    limits = config.trajectories.build_limits(mechanism.n_dof)
    upper = np.array([np.full(mechanism.n_q, size) for size in (np.inf, 2.0, 5.0)])
    lower = -upper
    lower[0, independent], upper[0, independent] = limits.lower, limits.upper
    lower[1, independent], upper[1, independent] = -limits.velocity, limits.velocity
    constraints = config.trajectories.build_constraints(mechanism)
    _, (q, dq, ddq) = drawn(robot, (lower, upper), constraints, known, 60)
    for values, low, high in zip((q, dq, ddq), lower, upper, strict=True):
        assert 30 <= len(values) <= 60
        assert np.all((values >= low - 1e-9) & (values <= high + 1e-9))
    z = q[:, independent]
    assert np.ptp(z, axis=0).min() > 1.5 * np.ptp(known[:, independent], axis=0).min(), (
        "they went somewhere"
    )
    again, way = coordinates.follow(z, q)
    assert np.all(way == 1)
    np.testing.assert_allclose(again, q, atol=1e-6)
    assert coordinates.compute_distance(q).min() >= coordinates.compute_distance(known).min()
    assert Quantities(mechanism, constraints).compute_rows(q).max(initial=-1.0) <= 0
    dependent = list(mechanism.dependent)
    for values, size in ((dq, 2.0), (ddq, 5.0)):
        assert 0.3 * size < np.abs(values[:, dependent]).max(), "not shorter than need be"
    expected = coordinates.compute_rates(q, dq[:, independent], ddq[:, independent])
    np.testing.assert_allclose(dq, expected[0], atol=1e-9)
    np.testing.assert_allclose(ddq, expected[1], atol=1e-9)
