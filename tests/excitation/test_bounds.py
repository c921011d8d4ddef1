"""Trajectories of closed loops that must keep bounds."""

import dataclasses

import numpy as np
import pytest
from conftest import config_and_model, slope

from paramreduce_cli.config import load_config
from paramreduce_cli.excitation.excitation_objective import FreeObjective, Level
from paramreduce_cli.excitation.fourier import evaluate_basis, sample_times
from paramreduce_cli.excitation.limits import LimitMap
from paramreduce_cli.excitation.optimiser import _Search, optimise_trajectory
from paramreduce_cli.excitation.workers import build_excitation
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.loops.follower import Follower
from paramreduce_cli.multibody.quantities import Quantities
from paramreduce_cli.records import Run
from paramreduce_cli.stages.build_model import build_model
from paramreduce_cli.stages.optimize_trajectories import make_task


@pytest.fixture(scope="module", params=["five_bar", "hexaglide"])
def case(request):
    config, model = config_and_model(request.param)
    task = make_task(config.trajectories, model)
    settings = dataclasses.replace(task.settings, starts=1, polished=1, max_iterations=20)
    return build_excitation(task), settings, task.constraints


def test_gradient_with_the_barrier_against_finite_differences(case):
    excitation, settings, _ = case
    search = _Search(excitation, settings)
    (start,) = search.draw_starts([3])
    assert search.compute_start_kappa(start) < 1e5  # beyond, round-off in the Gram matrix shows
    objective = search._build_objective(search._grid, Level(4, 80, 50, 0.1))
    x = start.free.ravel()
    value, gradient = objective(x)
    assert np.isfinite(value)
    rng = np.random.default_rng(0)
    for direction in rng.normal(size=(3, x.size)):
        found = slope(lambda x: objective(x)[0], [x], direction, step=1e-5)
        assert found == pytest.approx(gradient @ direction, rel=1e-3, abs=1e-2)


def test_a_motion_that_few_points_mistake_begins_anew_on_all(case):
    excitation, settings, _ = case
    settings = dataclasses.replace(settings, points=40 * settings.harmonics)
    search, all_points = (_Search(excitation, settings) for _ in range(2))
    all_points._coarse = all_points._grid
    (found,), (expected,) = search.draw_starts([7]), all_points.draw_starts([7])
    first, *_, last = search.plan.steps
    search.take_step(found, first)
    assert not search._is_astray(found)
    assert search._is_astray(dataclasses.replace(found, value=np.inf))
    few = dataclasses.replace(settings, points=2 * settings.harmonics + 1)
    search._coarse = _Search(excitation, few)._grid
    assert search._is_astray(found)
    search.take_step(found, last)
    for step in all_points.plan.steps:
        all_points.take_step(expected, step)
    assert found.free == pytest.approx(expected.free, rel=1e-9)


def test_the_best_motion_keeps_all_bounds_between_the_grid_points(case):
    excitation, settings, constraints = case
    found = optimise_trajectory(excitation, settings, [7])
    assert found.kappa < found.kappa_start
    harmonics = (found.coefficients.shape[1] - 1) // 2
    times = sample_times(settings.period, 4 * settings.points)
    z, dz, _ = evaluate_basis(settings.period, harmonics, times).evaluate(found.coefficients)
    limits = settings.limits
    assert ((z >= limits.lower) & (z <= limits.upper) & (np.abs(dz) <= limits.velocity)).all()
    q = Coordinates(excitation.coordinates.mechanism).compute_positions(z, None)
    values = Quantities(excitation.coordinates.mechanism, constraints).compute_values(q)
    assert (values >= [c.lower for c in constraints]).all()
    assert (values <= [c.upper for c in constraints]).all()
    extremes = np.column_stack([values.min(axis=0), values.max(axis=0)])
    assert found.extremes == pytest.approx(extremes, rel=1e-9)


def test_outside_the_bounds_there_is_no_value(case):
    excitation, settings, _ = case
    basis = settings.build_basis()
    limits = LimitMap(settings.limits, basis, settings.mapping)
    positions = Follower(excitation.coordinates)
    n = limits.n_dof
    level = Level(4, 40, 50, 0.1)
    objective = FreeObjective(excitation, basis, limits, level, positions, np.eye(n))
    far = np.random.default_rng(1).normal(size=n * limits.n_columns) * 10
    value, gradient = objective(far)
    assert np.isnan(value)
    assert np.isnan(gradient).all()


def test_a_crank_that_turns_fully_is_followed_all_the_way(write_config):
    """A massless coupler: one equation, whole turns, and many random starts far apart."""
    path = write_config(
        ("      - {name: coupler, parent: crank, at: [crank, 0, 0], coordinates: q_coupler}\n", ""),
        ("    coupler: {m: 2.0, com: [0.45, 0.02, 0], inertia_com: [2e-4, 0, 0, 0.135, 0, 0.135]}\n", ""),
        ("type: planar, bodies: [coupler, rocker], at: [[coupler, 0, 0], ",
         "type: distance, length: coupler, bodies: [crank, rocker], at: [[crank, 0, 0], "),
        ("q_coupler: -pi/3, ", ""),
        robot="four_bar",
    )  # fmt: skip
    config = load_config(path)
    model = build_model(config, config.model, Run())
    wanted = config.trajectories.model_copy(update={"scaling": "weighted", "harmonics": 3})
    task = make_task(wanted, model, 2 * np.pi)
    excitation = build_excitation(task)
    settings = dataclasses.replace(task.settings, starts=3, polished=2, max_iterations=40)
    for seed in range(2):
        found = optimise_trajectory(excitation, settings, [seed])
        assert np.isfinite(found.kappa)
        assert found.reach[0] > 0.9
    distance = Coordinates(model.mechanism).compute_distance(model.mechanism.loops.assembly[None])[
        0
    ]
    assert 0 < distance < 1
