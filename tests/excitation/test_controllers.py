"""Trajectories that a real controller can run: at rest at both ends, within torques and distances."""

import dataclasses
import itertools
import json
import types

import numpy as np
import pytest
import yaml
from conftest import ROOT, config_and_model, config_of, slope
from oracles import capsules, pinocchio_model

from paramreduce_cli.config.clearance import ClearanceSection
from paramreduce_cli.config.error_keys import locate_error
from paramreduce_cli.errors import ConfigError, DataError, NumericalError
from paramreduce_cli.excitation.excitation_objective import FreeObjective, Level
from paramreduce_cli.excitation.fourier import evaluate_basis, sample_times
from paramreduce_cli.excitation.limits import LimitMap
from paramreduce_cli.excitation.optimiser import optimise_trajectory
from paramreduce_cli.excitation.workers import build_excitation
from paramreduce_cli.export.trajectory_formats import trajectory_formats
from paramreduce_cli.motion.approach import PathPlanner, make_rest_state
from paramreduce_cli.motion.timed_motion import sample_motion
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.follower import Follower
from paramreduce_cli.multibody.quantities import Quantities
from paramreduce_cli.records import Items, Run
from paramreduce_cli.stages.optimize_trajectories import make_task, optimize_trajectories

ASKED = [
    "trajectories.rest_to_rest=true",
    "trajectories.harmonics=4",
    "trajectories.use_full_range=false",
    "trajectories.torque_limits=[14, 4]",
    "trajectories.power_limits=[10, 4]",
    "trajectories.acceleration_limits=9",
    "trajectories.position_limits=[[-2.6, -0.5], [-pi/2, pi/2]]",
    "trajectories.start_pose=[-pi/2, 0]",
]

CEILING = 1.1
"""m"""


@pytest.fixture(scope="module")
def made():
    """The two-link arm, which hangs down."""
    config, model = config_and_model("two_link", *ASKED)
    return config, model, optimize_trajectories(config.trajectories, model, None, Run(), Items())


def states(trajectories, trajectory, finer=10):
    time = sample_times(trajectories.period, finer * trajectories.points)
    harmonics = (trajectory.coefficients.shape[1] - 1) // 2
    return evaluate_basis(trajectories.period, harmonics, time).evaluate(trajectory.coefficients)


def test_all_is_kept_on_a_finer_grid(made):
    _, model, trajectories = made
    limits = trajectories.limits
    for trajectory in (*trajectories.estimation, *trajectories.validation):
        z, dz, ddz = states(trajectories, trajectory)
        assert np.abs([dz[0], ddz[0]]).max() < 1e-10
        tau = pinocchio_model.inverse_dynamics(model.mechanism, model.values, z, dz, ddz)
        slack = 1 + 1e-9
        assert np.all((z >= limits.lower - 1e-9) & (z <= limits.upper + 1e-9))
        assert np.all(np.abs(dz) <= limits.velocity * slack)
        assert np.all(np.abs(ddz) <= limits.acceleration * slack)
        assert np.all(np.abs(tau) <= limits.torque * slack)
        assert np.all(np.abs(tau * dz) <= limits.power * slack)
        share = [np.abs(tau) / limits.torque, np.abs(tau * dz) / limits.power, np.abs(dz) / limits.velocity,
                 np.abs(ddz) / limits.acceleration]  # fmt: skip
        assert max(s.max() for s in share) > 0.7  # something is made use of
        assert trajectory.peak_torque == pytest.approx(np.abs(tau).max(axis=0), rel=3e-2)


def test_rest_costs_little(made):
    _, model, trajectories = made
    asked = [text for text in ASKED if "rest_to_rest" not in text]
    moving, _ = config_and_model("two_link", *asked)
    free = optimize_trajectories(moving.trajectories, model, None, Run(), Items())
    kappa = [min(t.kappa for t in found.estimation) for found in (trajectories, free)]
    assert kappa[0] < 1.5 * kappa[1]


@pytest.mark.parametrize("seed", [0, 1])
def test_gradients_of_loads_and_rest(seed):
    config, model = config_and_model("two_link", *ASKED)
    task = make_task(config.trajectories, model)
    excitation = build_excitation(task)
    basis = task.settings.build_basis()
    limits = LimitMap(task.settings.limits, basis, "ball", rest_to_rest=True)
    loose = dataclasses.replace(
        excitation,
        loads=dataclasses.replace(
            excitation.loads, torque=np.full(2, 400.0), power=np.full(2, 900.0)
        ),
    )
    follower = Follower(excitation.coordinates)
    objective = FreeObjective(loose, basis, limits, Level(4, 30, 30, 0.3), follower, np.eye(2))
    rng = np.random.default_rng(seed)
    x = 0.5 * rng.normal(size=2 * limits.n_columns)
    value, gradient = objective(x)
    assert np.isfinite(value)
    for direction in rng.normal(size=(4, x.size)):
        found = slope(lambda x: objective(x)[0], [x], direction, step=1e-6)
        assert found == pytest.approx(gradient @ direction, rel=1e-4, abs=1e-6)


def test_noise_of_torques_weights_the_rows():
    """D-optimality and condition number by definition, and peaks of torque without weights."""
    noise = np.array([0.4, 0.02])
    config, model = config_and_model("two_link", *ASKED, "trajectories.torque_noise=[0.4, 0.02]")
    plain, _ = config_and_model("two_link", *ASKED)
    weighted, usual = (build_excitation(make_task(c.trajectories, model)) for c in (config, plain))
    rng = np.random.default_rng(0)
    z, dz, ddz = rng.normal(size=(3, 40, 2))
    dynamics = Dynamics(model.mechanism)
    W = dynamics.compute_regressor(z, dz, ddz)[..., model.base.columns] / noise[:, None]
    W = W.reshape(80, -1)
    unit = W / np.linalg.norm(W, axis=0)
    found = weighted.compute_condition_numbers(z, dz, ddz)
    assert found["column-normalised"] == pytest.approx(np.linalg.cond(unit), rel=1e-9)
    assert found != pytest.approx(usual.compute_condition_numbers(z, dz, ddz), rel=0.05)
    np.testing.assert_allclose(
        weighted.compute_peak_torques(z, dz, ddz), usual.compute_peak_torques(z, dz, ddz)
    )
    assert weighted.compute_load_ratio(z, dz, ddz) == pytest.approx(
        usual.compute_load_ratio(z, dz, ddz), rel=1e-9
    )
    made = optimize_trajectories(config.trajectories, model, None, Run(), Items())
    for trajectory in made.estimation:
        own = weighted.compute_condition_numbers(*states(made, trajectory, finer=1))
        assert own["column-normalised"] == pytest.approx(trajectory.kappa, rel=1e-6)


def test_limits_that_no_motion_keeps_are_said():
    config, model = config_and_model(
        "two_link", *[t for t in ASKED if "torque" not in t], "trajectories.torque_limits=[0.5, 0.1]",
        "trajectories.start_pose=[-0.6, 0]",
    )  # fmt: skip
    task = make_task(config.trajectories, model)
    excitation = build_excitation(task)
    with pytest.raises(NumericalError, match="leave no motion") as error:
        optimise_trajectory(excitation, task.settings, [0])
    assert locate_error(error.value).key == ("trajectories", "torque_limits")


@pytest.fixture(scope="module")
def ur10():
    return config_of("ur10").build_mechanism()


def test_distances_are_never_overestimated(ur10):
    """Against capsules by brute force; what spheres cover too much is little."""
    mechanism = ur10
    section = ClearanceSection(
        radius=0.05, gap=0.01, planes=[{"name": "floor", "point": [0, 0, -0.4]}]
    )
    constraints = tuple(section.build_constraints(mechanism))
    quantities = Quantities(mechanism, constraints)
    rng = np.random.default_rng(0)
    q = rng.uniform(-np.pi, np.pi, (60, 6))
    values, rows = quantities.compute_values(q), quantities.compute_rows(q)
    pairs = [c.bodies for c in constraints if c.kind == "clearance"]
    assert pairs
    seen = 0
    for k, pose in enumerate(q):
        truth = capsules.clearances(mechanism, pose, 0.05, pairs)
        where = capsules.points(mechanism, pose)
        for c, constraint in enumerate(constraints):
            if constraint.kind == "clearance":
                exact = truth[pairs.index(constraint.bodies)]
            else:
                exact = (where[constraint.bodies[0]][:, 2] + 0.4).min() - 0.05
            near = -0.1 < exact < 0.1  # farther away smooth minima mean less
            seen += near
            if near:
                assert values[k, c] <= exact + 1e-6
                assert values[k, c] >= exact - 0.05
            if rows[k, c] <= 0:
                assert exact >= constraint.lower - 1e-6
    assert seen > 20


def test_bodies_that_are_near_anyway_or_ignored_are_not_looked_at(ur10):
    mechanism = ur10
    names = [body.name for body in mechanism.bodies]
    found = {c.name for c in ClearanceSection().build_constraints(mechanism)}
    assert f"{names[0]}-{names[1]}" not in found
    assert f"base-{names[5]}" in found
    less = ClearanceSection(ignore=[["base", names[5]]], capsules={names[4]: []})
    left = {c.name for c in less.build_constraints(mechanism)}
    assert f"base-{names[5]}" not in left
    assert not any(names[4] in name for name in left)


def test_bodies_of_a_clearance_must_be_there(ur10):
    with pytest.raises(ConfigError, match="names the body hand; there is"):
        list(ClearanceSection(ignore=[["base", "hand"]]).build_constraints(ur10))


@pytest.fixture(scope="module")
def motion(made):
    _, model, trajectories = made
    return sample_motion(
        model.mechanism, trajectories, trajectories.estimation[0], rate=500.0, title="two_link",
        start_pose=np.array([-np.pi / 2, 0.0]), planner=PathPlanner(model, trajectories),
    )  # fmt: skip


def test_a_motion_begins_and_ends_where_the_machine_stands(motion, made):
    limits = made[2].limits
    for k in (0, -1):
        assert motion.z[k] == pytest.approx([-np.pi / 2, 0], abs=1e-4)
        assert motion.dz[k] == pytest.approx(0, abs=2e-3)
    assert motion.lead > 0
    assert np.all(np.abs(motion.dz) <= limits.velocity * (1 + 1e-6))
    # Speeds are the slopes of the positions, accelerations those of the speeds, without a jump.
    for values, slopes in ((motion.z, motion.dz), (motion.dz, motion.ddz)):
        middle = (values[2:] - values[:-2]) / (2 / motion.rate)
        assert np.abs(middle - slopes[1:-1]).max() < 0.02 * np.abs(slopes).max() + 1e-3
    assert np.abs(np.diff(motion.ddz, axis=0)).max() < 0.1 * np.abs(motion.ddz).max()


def test_ways_keep_to_torques_and_powers(motion, made):
    """By Pinocchio, on both ways; without limits of torque they are faster."""
    _, model, trajectories = made
    limits = trajectories.limits
    on_way = (motion.time < motion.lead) | (motion.time > motion.lead + motion.period)
    states = (motion.z[on_way], motion.dz[on_way], motion.ddz[on_way])
    tau = pinocchio_model.inverse_dynamics(model.mechanism, model.values, *states)
    assert np.all(np.abs(tau) <= limits.torque * 1.02)
    assert np.all(np.abs(tau * states[1]) <= limits.power * 1.02)
    hanging, away = (
        make_rest_state(np.array(pose)) for pose in ([-np.pi / 2, 0], [-np.pi / 2 + 0.7, -0.5])
    )
    (fast,) = PathPlanner(model, trajectories).plan(hanging, away)
    z, dz, ddz = fast.compute_states(np.linspace(0, fast.duration, 200))
    still = np.zeros_like(z)
    peak, holding = (
        np.abs(pinocchio_model.inverse_dynamics(model.mechanism, model.values, *s)).max(axis=0)
        for s in ((z, dz, ddz), (z, still, still))
    )
    slow = dataclasses.replace(
        trajectories, limits=dataclasses.replace(limits, torque=(peak + holding) / 2)
    )
    (slower,) = PathPlanner(model, slow).plan(hanging, away)
    assert slower.duration > 1.05 * fast.duration
    weakest = dataclasses.replace(
        trajectories, limits=dataclasses.replace(limits, torque=np.full(2, 0.1))
    )
    with pytest.raises(DataError, match="keeps the limits"):
        PathPlanner(model, weakest).plan(hanging, away)


@pytest.mark.parametrize(("upper", "turned"), [(7.0, True), (2.0, False)])
def test_a_joint_is_turned_to_where_the_machine_stands(made, upper, turned):
    """A pose one turn away is the same pose, if the limits let the trajectory be there."""
    _, model, trajectories = made
    limits = dataclasses.replace(trajectories.limits, upper=np.array([upper, np.pi / 2]))
    wide = dataclasses.replace(trajectories, limits=limits)
    pose = np.array([-np.pi / 2 + 2 * np.pi if turned else 1.9, 0.0])
    found, usual = (
        sample_motion(
            model.mechanism, wide, trajectories.estimation[0], rate=100.0, title="x", **where
        )
        for where in ({"start_pose": pose, "planner": PathPlanner(model, wide)}, {})
    )
    first = int(np.searchsorted(found.time, found.lead - 1e-9))
    moved = found.z[first] - usual.z[0]
    assert moved == pytest.approx([2 * np.pi * turned, 0], abs=0.05)


def test_a_way_around_what_is_in_the_way(ur10):
    """Under a ceiling an arm cannot swing over the top: it passes a third pose, clear by brute force all along."""
    ceiling = {"name": "ceiling", "point": [0, 0, CEILING], "normal": [0, 0, -1]}
    section = ClearanceSection(radius=0.05, planes=[{"name": "table"}, ceiling])
    config = config_of("ur10")
    model = types.SimpleNamespace(mechanism=ur10, values=config.get_values())
    constraints = tuple(section.build_constraints(model.mechanism))
    trajectories = types.SimpleNamespace(
        limits=config.trajectories.build_limits(6), constraints=constraints, period=1.0
    )
    start, end = np.array([0, -0.6, 0.5, 0, 0, 0.0]), np.array([0, -np.pi + 0.6, -0.5, 0, 0, 0.0])
    pairs = [c.bodies for c in constraints if c.kind == "clearance"]
    bodies = {c.bodies[0] for c in constraints if c.kind == "above-plane"}

    def clear(z):
        found = []
        for q in z:
            where = capsules.points(model.mechanism, q)
            found += capsules.clearances(model.mechanism, q, 0.05, pairs)
            for body in bodies:
                height = where[body][:, 2]
                found += [height.min() - 0.05, CEILING - height.max() - 0.05]
        return min(found)

    blocked = np.linspace(start, end, 60)
    assert clear(blocked[[0, -1]]) > 0
    assert clear(blocked) < 0
    ways = PathPlanner(model, trajectories).plan(make_rest_state(start), make_rest_state(end))
    assert len(ways) > 1
    states = [way.compute_states(np.linspace(0, way.duration, 80)) for way in ways]
    assert min(clear(z) for z, _, _ in states) > 0
    for (z, dz, _), (z_after, dz_after, _) in itertools.pairwise(states):
        assert z[-1] == pytest.approx(z_after[0])
        assert dz[-1] == pytest.approx(dz_after[0], abs=1e-9)


def test_without_a_pose_it_is_the_trajectory_alone(made):
    _, model, trajectories = made
    found = sample_motion(
        model.mechanism, trajectories, trajectories.estimation[0], rate=100.0, title="x"
    )
    assert found.time[-1] == pytest.approx(trajectories.period, abs=0.01)
    assert found.dz[0] == pytest.approx(0, abs=1e-12)


def test_a_pose_that_cannot_be_reached_is_said(made):
    _, model, trajectories = made
    with pytest.raises(DataError, match="start_pose") as error:
        PathPlanner(model, trajectories).plan(
            make_rest_state(np.array([2.0, 0.0])), make_rest_state(np.zeros(2))
        )
    assert "{" not in str(error.value)


def test_formats_hold_the_same(motion):
    table = np.genfromtxt(
        trajectory_formats["csv"](motion)["trajectory.csv"].splitlines(), delimiter=",", names=True
    )
    assert table["q1"] == pytest.approx(motion.z[:, 0], abs=1e-7)
    plain = json.loads(trajectory_formats["json"](motion)["trajectory.json"])
    assert np.array(plain["velocities"]) == pytest.approx(motion.dz, abs=1e-8)
    assert plain["joints"] == list(motion.names)
    message = yaml.safe_load(trajectory_formats["ros"](motion)["joint_trajectory.yaml"])
    assert message["joint_names"] == list(motion.names)
    last = message["points"][-1]
    assert last["positions"] == pytest.approx(motion.z[-1].tolist(), abs=1e-8)
    stamp = last["time_from_start"]
    assert stamp["sec"] + 1e-9 * stamp["nanosec"] == pytest.approx(motion.time[-1])
    with pytest.raises(ConfigError, match="arms of 6 joints"):
        trajectory_formats["urscript"](motion)
    six = dataclasses.replace(motion, names=("j",) * 6, z=np.tile(motion.z, 3))
    script = trajectory_formats["urscript"](six)["trajectory.script"]
    assert script.count("servoj(") == motion.time.size - 1
    assert "t=0.002000" in script


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (["trajectories.rest_to_rest=true", "trajectories.harmonics=1"], "need 2 or more"),
        (
            ["unmeasured=[z_fore]", "trajectories.torque_limits=[9, 9]"],
            "whose torque is unmeasured",
        ),
        (["trajectories.start_pose=[1, 2, 3]"], "start_pose has 3 values"),
    ],
)
def test_what_cannot_be_asked(settings, said, tmp_path, invoke):
    config = ROOT / "configs" / "two_link.yaml"
    assert (
        said in invoke("build-model", config, "--results", tmp_path, settings=settings, code=2).err
    )


def test_the_command(tmp_path, invoke):
    config, results = ROOT / "configs" / "two_link.yaml", tmp_path / "r"
    for stage in ("build-model", "optimize-trajectories"):
        invoke(stage, config, "--results", results, settings=ASKED)
    arguments = ("export-trajectory", config, "--results", results, "--format", "ros")
    out = invoke(*arguments, settings=ASKED).out
    assert "joint_trajectory.yaml" in out
    assert "begins in motion" not in out
    error = invoke(*arguments, "--which", "estimation:9", settings=ASKED, code=2).err
    assert "there is estimation:1...2, validation:1...1" in error
    others = [text for text in ASKED if "power" not in text]
    assert (
        "was made with another trajectories section"
        in invoke(*arguments, settings=others, code=2).err
    )


def test_code_for_a_controller_that_begins_in_motion_is_refused(two_link_copy, invoke):
    arguments = (
        "export-trajectory",
        ROOT / "configs" / "two_link.yaml",
        "--results",
        two_link_copy,
    )
    for kind in ("ros", "urscript"):
        refused = invoke(*arguments, "--format", kind, code=2).err
        assert "begins in motion, at up to" in refused
        assert "--allow-moving-start" in refused
        assert not (two_link_copy / "export").exists()
    out = invoke(*arguments, "--format", "ros", "--allow-moving-start").out
    assert "which begins in motion at up to" in out
    assert "begins in motion" in invoke(*arguments, "--format", "csv").out
