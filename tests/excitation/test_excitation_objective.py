import dataclasses

import numpy as np
import pytest
from conftest import config_and_model, slope

from paramreduce_cli.excitation.criteria import criteria
from paramreduce_cli.excitation.excitation_objective import FreeObjective, Level
from paramreduce_cli.excitation.fourier import evaluate_basis, sample_times
from paramreduce_cli.excitation.limits import LimitMap
from paramreduce_cli.excitation.scalings import scalings
from paramreduce_cli.excitation.workers import build_excitation
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.follower import Follower
from paramreduce_cli.records import JointLimits
from paramreduce_cli.stages.optimize_trajectories import make_task

NOMINAL = np.array([350, 300, 125, 8, 3, 1.0])


@pytest.fixture(scope="module")
def parts():
    config, model = config_and_model("puma560")
    excitation = build_excitation(make_task(config.trajectories, model))
    return Dynamics(model.mechanism), model.base, excitation


def basis_and_limits(mapping="gauge", acceleration=np.inf):
    basis = evaluate_basis(2 * np.pi, 4, sample_times(2 * np.pi, 100))
    limits = JointLimits(
        *(np.full(6, limit) for limit in (-1.2, 1.6, 1.45, acceleration, np.inf, np.inf))
    )
    return basis, LimitMap(limits, basis, mapping), limits


@pytest.mark.parametrize("mapping", ["gauge", "ball"])
@pytest.mark.parametrize("scaling", list(scalings))
@pytest.mark.parametrize("criterion", list(criteria))
def test_gradients_against_finite_differences(parts, criterion, scaling, mapping):
    basis, limits, _ = basis_and_limits(mapping)
    chosen = {"criterion": criteria[criterion], "scaling": scalings[scaling]}
    measured = dataclasses.replace(parts[2], **chosen)
    follower = Follower(measured.coordinates)
    objective = FreeObjective(measured, basis, limits, Level(4, 30, 30), follower, np.eye(6))
    rng = np.random.default_rng(1)
    x = rng.normal(size=54) * 0.5
    _, gradient = objective(x)
    for direction in rng.normal(size=(4, 54)):
        found = slope(lambda x: objective(x)[0], [x], direction, step=1e-5)
        assert found == pytest.approx(gradient @ direction, rel=1e-3, abs=1e-4)


@pytest.mark.parametrize("scaling", list(scalings))
def test_sharp_objective_is_the_logarithm_of_the_condition_number(parts, scaling):
    measured = dataclasses.replace(parts[2], scaling=scalings[scaling])
    basis, limits, _ = basis_and_limits()
    coefficients = limits.scale_to_limits(np.random.default_rng(2).normal(size=(6, 9)))
    follower = Follower(measured.coordinates)
    exact = Level(np.inf, np.inf, np.inf)
    value, _ = measured.evaluate(basis, coefficients, exact, follower)
    kappa = measured.compute_condition_numbers(*basis.evaluate(coefficients))[scaling]
    assert np.exp(value) == pytest.approx(kappa, rel=1e-4)


def test_variants_by_their_definitions(parts):
    dynamics, base, excitation = parts
    basis, limits, _ = basis_and_limits()
    states = basis.evaluate(limits.scale_to_limits(np.random.default_rng(3).normal(size=(6, 9))))
    W = dynamics.compute_regressor(*states).reshape(-1, 60) / np.tile(NOMINAL, 100)[:, None]
    Wb = W[:, base.columns]
    equilibrated = Wb / np.abs(Wb).max(axis=0)
    equilibrated = equilibrated / np.abs(equilibrated).max(axis=1, keepdims=True)
    singular = np.linalg.svd(W, compute_uv=False)
    expected = {
        "column-normalised": np.linalg.cond(Wb / np.linalg.norm(Wb, axis=0)),
        "weighted": np.linalg.cond(Wb),
        "equilibrated": np.linalg.cond(equilibrated),
        "full": singular[0] / singular[35],
    }
    assert excitation.compute_condition_numbers(*states) == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("acceleration", [np.inf, 2.0])
def test_limits_hold_between_the_grid_points_and_are_reached(acceleration):
    _, limits, given = basis_and_limits("gauge", acceleration)
    coefficients = limits.scale_to_limits(np.random.default_rng(4).normal(size=(6, 9)))
    fine = evaluate_basis(2 * np.pi, 4, sample_times(2 * np.pi, 5000))
    z, dz, ddz = fine.evaluate(coefficients)
    assert (z >= given.lower).all()
    assert (z <= given.upper).all()
    assert (np.abs(dz) <= given.velocity).all()
    assert (np.abs(ddz) <= given.acceleration).all()
    limited = ((z - given.middle, given.reach), (dz, given.velocity), (ddz, given.acceleration))
    shares = np.max([np.abs(x).max(axis=0) / limit for x, limit in limited], axis=0)
    assert (shares > 0.97).all()


def test_the_ball_leaves_small_series_alone():
    _, limits, _ = basis_and_limits("ball")
    small = np.random.default_rng(5).normal(size=(6, 9)) * 1e-3
    coefficients, _ = limits.map_to_admissible(small, 30)
    assert np.allclose(coefficients[:, 1:], small[:, 1:], rtol=1e-12)


def test_a_joint_cannot_meet_its_limit_by_being_parked_there():
    basis, limits, given = basis_and_limits()
    free = np.random.default_rng(6).normal(size=(6, 9)) * 1e-3
    free[:, 0] = 1e6
    z, dz, _ = basis.evaluate(limits.scale_to_limits(free))
    moved = np.maximum(np.ptp(z, axis=0) / (2 * given.reach), np.abs(dz).max(axis=0) / 1.45)
    assert (moved > 0.9).all()
    assert (z <= given.upper).all()


def test_trajectories_follow_a_rounded_sign_and_are_measured_by_the_true_one():
    config, model = config_and_model("two_link", "drives.all.coulomb=2")
    excitation = build_excitation(make_task(config.trajectories, model))
    rng = np.random.default_rng(0)
    states = tuple(rng.normal(size=(3, 50, 2)))
    expected = Dynamics(model.mechanism).compute_regressor(*states)[..., model.base.columns]
    assert np.array_equal(excitation.measured(*states), expected.reshape(100, -1))
    smooth = excitation.observation.evaluate(*states).reshape(expected.shape)
    friction = model.mechanism.parameter_names.index("fc_z_upper")
    rounded = np.tanh(states[1][:, 0] / (0.02 * 3))  # the velocity limit is 3 rad/s
    assert smooth[:, 0, list(model.base.columns).index(friction)] == pytest.approx(rounded)
