"""Closed loops against Lagrange's equations with multipliers, and against power balance."""

import dataclasses
from functools import partial

import numpy as np
import pytest
import scipy.linalg
from conftest import CLOSED_LOOPS, config_of, slope
from oracles.lagrange import Lagrange, forward_dynamics, tangent

from paramreduce_cli.errors import DataError, NumericalError, ParamreduceWarning
from paramreduce_cli.excitation.fourier import evaluate_basis, sample_times
from paramreduce_cli.multibody import regressor
from paramreduce_cli.multibody.base_parameters import choose_base, find_affecting_columns
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.kinematics import compute_body_poses
from paramreduce_cli.multibody.loops.assembly import _choose_equations, assemble
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.loops.follower import Follower
from paramreduce_cli.multibody.quantities import Quantities
from paramreduce_cli.multibody.random_states import draw_states
from paramreduce_cli.records import Constraint, Mechanism
from paramreduce_cli.robots import Description, Robot
from paramreduce_cli.robots.frames import translate

REACH = {"hexaglide": 0.03, "five_bar": 0.2, "four_bar": 0.8, "rssr": 0.8, "delta": 0.3,
         "humanoid_leg": 0.2}  # fmt: skip
"""Amplitudes of independent coordinates about the assembly, rad or m, that all loops survive."""


@pytest.fixture(scope="module", params=CLOSED_LOOPS)
def case(request):
    config = config_of(request.param)
    mechanism = assemble(config.build_mechanism())
    rng = np.random.default_rng(3)
    phi = config.get_values() + rng.normal(size=mechanism.n_parameters) * 1e-2
    return mechanism, Lagrange(mechanism), phi


def closed(robot):
    return assemble(config_of(robot).build_mechanism())


def states_of(mechanism, count=4):
    return draw_states(mechanism, count, np.random.default_rng(1))


def motion(mechanism, points, seed=0):
    """A random periodic motion about the assembly, with its time derivatives."""
    rng = np.random.default_rng(seed)
    coefficients = rng.normal(size=(mechanism.n_dof, 5)) * REACH[mechanism.robot] / 3
    coefficients[:, 0] = mechanism.loops.assembly[list(mechanism.independent)]
    basis = evaluate_basis(2 * np.pi, 2, sample_times(2 * np.pi, points))
    return basis.time, Coordinates(mechanism).compute_states(*basis.evaluate(coefficients))


def test_states_satisfy_the_closures_and_their_derivatives(case):
    mechanism, oracle, _ = case
    for q, dq, ddq in zip(*states_of(mechanism), strict=True):
        gap, J, drift = (np.array(part) for part in oracle.closures(q, dq))
        assert np.abs(gap).max() < 1e-12
        scale = np.abs(J).max()
        assert np.abs(J @ dq).max() < 1e-11 * scale * np.abs(dq).max()
        left = J @ ddq + drift.ravel()
        assert np.abs(left).max() < 1e-11 * scale * np.abs(ddq).max()


def test_torques_against_lagrange(case):
    mechanism, oracle, phi = case
    states = states_of(mechanism)
    found = Dynamics(mechanism).compute_torques(*states, phi)
    for k, (q, dq, ddq) in enumerate(zip(*states, strict=True)):
        R = tangent(oracle, mechanism.independent, q)
        expected = R.T @ np.array(oracle.tau(q, dq, ddq, phi)).ravel()
        assert found[k] == pytest.approx(expected, rel=1e-8, abs=1e-8 * np.abs(expected).max())


def test_mass_matrix_bias_and_accelerations_against_the_kkt_system(case):
    mechanism, oracle, phi = case
    independent = list(mechanism.independent)
    q_all, dq_all, _ = states_of(mechanism)
    all_M, all_delta = Dynamics(mechanism).compute_mass_matrix_and_bias(q_all, dq_all, phi)
    rng = np.random.default_rng(2)
    for k, (q, dq) in enumerate(zip(q_all, dq_all, strict=True)):
        M, delta = all_M[k], all_delta[k]
        # The KKT system is linear in tau: its response to unit torques is M^-1, at rest -M^-1 delta.
        respond = partial(forward_dynamics, oracle, independent, q, dq, phi)
        rest = respond(np.zeros(mechanism.n_dof))
        units = np.array([respond(unit) - rest for unit in np.eye(mechanism.n_dof)])
        M_kkt = np.linalg.inv(units[:, independent].T)
        assert pytest.approx(M_kkt, rel=1e-8, abs=1e-8 * np.abs(M_kkt).max()) == M
        expected = -M_kkt @ rest[independent]
        assert delta == pytest.approx(expected, rel=1e-8, abs=1e-8 * np.abs(expected).max())
        tau = rng.normal(size=mechanism.n_dof) * np.abs(delta).max()
        ddq = respond(tau)
        ddz = np.linalg.solve(M, tau - delta)
        assert ddz == pytest.approx(ddq[independent], rel=1e-8, abs=1e-8 * np.abs(ddq).max())


def test_power_balance(case):
    """d/dt (T + V) = tau . dz, with the rate of a periodic energy by its Fourier transform."""
    mechanism, oracle, phi = case
    points = 256
    _, (q, dq, ddq) = motion(mechanism, points)
    energy = np.array(oracle.energy.map(points)(q.T, dq.T, np.tile(phi, (points, 1)).T)).ravel()
    frequency = 1j * np.fft.rfftfreq(points, 1 / points)
    rate = np.fft.irfft(frequency * np.fft.rfft(energy), points)
    tau = Dynamics(mechanism).compute_torques(q, dq, ddq, phi)
    power = np.einsum("kj,kj->k", tau, dq[:, list(mechanism.independent)])
    assert np.abs(power).max() > 1e-3
    assert np.abs(rate - power).max() < 1e-7 * np.abs(power).max()


def test_base_count_is_the_rank_of_the_oracles_observation_matrix(case):
    mechanism, oracle, phi = case
    rows = []
    for q, dq, ddq in zip(*draw_states(mechanism, 60, np.random.default_rng(5)), strict=True):
        R = tangent(oracle, mechanism.independent, q)
        rows.append(R.T @ np.array(oracle.tau_by_phi(q, dq, ddq, phi)))
    W = np.vstack(rows)
    lengths = np.linalg.norm(W, axis=0)
    live = lengths > 1e-10 * lengths.max()
    singular = np.linalg.svd(W[:, live] / lengths[live], compute_uv=False)
    rank = int(np.sum(singular > 1e-9 * singular[0]))
    states = draw_states(mechanism, 300, np.random.default_rng(0))
    K = Dynamics(mechanism).compute_regressor(*states).reshape(-1, mechanism.n_parameters)
    base = choose_base(K, mechanism.preference_order, 1e-9)
    assert (find_affecting_columns(K).sum(), base.columns.size) == (live.sum(), rank)


def test_a_point_mass_at_a_spherical_joint_may_belong_to_either_body():
    """The six null vectors: a unit mass at the end of a bar, taken from the platform."""
    mechanism = closed("hexaglide")
    W = Dynamics(mechanism).compute_regressor(*states_of(mechanism, 40)).reshape(-1, 70)
    W = W / np.linalg.norm(W, axis=0).max()
    names = mechanism.parameter_names
    for closure in mechanism.loops.closures:
        null = np.zeros(70)
        for body, frame, sign in zip(closure.bodies, closure.frames, (1, -1), strict=True):
            name, (x, y, z) = mechanism.bodies[body].name, frame[:3, 3]
            point = {"m": 1, "mx": x, "my": y, "mz": z, "Ixx": y * y + z * z, "Iyy": x * x + z * z,
                     "Izz": x * x + y * y, "Ixy": -x * y, "Ixz": -x * z, "Iyz": -y * z}  # fmt: skip
            for kind, value in point.items():
                null[names.index(f"{kind}_{name}")] += sign * value
        assert np.abs(null).max() >= 1
        assert np.abs(W @ null).max() < 1e-12


def test_large_regressors_are_projected_as_matrices(monkeypatch):
    """With the same results as those that are written out as scalars."""
    mechanism, columns = closed("five_bar"), np.arange(3, 8)
    q, dq, ddq = states_of(mechanism, 6)
    states = [part[:, list(mechanism.independent)] for part in (dq, ddq)]
    W_bar = np.random.default_rng(0).normal(size=(6 * mechanism.n_dof, 5))

    def results():
        dynamics = Dynamics(mechanism, once=True)
        observation = dynamics.make_observation(columns)
        W = observation.evaluate(q, *states)
        return [
            dynamics.compute_regressor(q, dq, ddq),
            W,
            *observation.compute_vector_jacobian_product(q, *states, W_bar),
        ]

    scalars = results()
    monkeypatch.setattr(regressor, "_FLAT", -1)
    for one, other in zip(scalars, results(), strict=True):
        assert one == pytest.approx(other, rel=1e-10, abs=1e-10 * np.abs(other).max())


@pytest.mark.parametrize("name", CLOSED_LOOPS)
def test_adjoint_of_observations_through_the_position_problem(name):
    mechanism = closed(name)
    observation = Dynamics(mechanism).make_observation(np.arange(3, 8))
    coordinates = Coordinates(mechanism)
    q, dq, ddq = states_of(mechanism, 6)
    states = [part[:, list(mechanism.independent)] for part in (q, dq, ddq)]
    rng = np.random.default_rng(0)
    W_bar = rng.normal(size=(6 * mechanism.n_dof, 5))
    bars = observation.compute_vector_jacobian_product(q, *states[1:], W_bar)

    def value(z, dz, ddz):
        return np.sum(observation.evaluate(coordinates.compute_positions(z, q), dz, ddz) * W_bar)

    for k, bar in enumerate(bars):
        direction = rng.normal(size=bar.shape)
        found = slope(value, states, direction, k, step=1e-7)
        size = np.sum(np.abs(bar * direction))
        assert found == pytest.approx(np.sum(bar * direction), abs=1e-5 * size)


QUANTITIES = [
    Constraint("low", "coordinate", (1,), (), -0.5, 2.0),
    Constraint("tilt", "angle", (0, 2), (np.array([1.0, 0, 0]), np.array([0.6, 0.8, 0])), 0.1, 2.5),
    Constraint("apart", "distance", (1, 2), (np.array([0.2, 0, 0]), np.array([0, 0.1, 0])), 0.1, 1),
    Constraint(
        "radius", "distance-from-axis", (1, -1),
        (np.array([0.3, 0.1, 0]), np.array([0.1, 0, 0]), np.array([0, 1.0, 0])), 0.05, 1.5,
    ),
    Constraint("away", "singularity", (), (), 0.05, np.inf),
]  # fmt: skip


def test_quantities_by_their_definitions_and_their_derivatives():
    mechanism = closed("five_bar")
    quantities = Quantities(mechanism, QUANTITIES)
    q, _, _ = states_of(mechanism, 5)
    values = quantities.compute_values(q)
    for k, one in enumerate(q):
        poses = compute_body_poses(mechanism, one)
        end = (poses[1] @ [0.2, 0, 0, 1])[:3] - (poses[2] @ [0, 0.1, 0, 1])[:3]
        u, v = poses[0][:3, 0], poses[2][:3, :3] @ [0.6, 0.8, 0]
        seen = (poses[1] @ [0.3, 0.1, 0, 1])[:3] - [0.1, 0, 0]
        expected = [one[1], np.arccos(u @ v), np.linalg.norm(end), np.hypot(seen[0], seen[2])]
        assert values[k, :4] == pytest.approx(expected, rel=1e-12)
    rows = quantities.compute_rows(q)
    inside = (values >= [c.lower for c in QUANTITIES]) & (values <= [c.upper for c in QUANTITIES])
    for j in range(len(QUANTITIES)):
        own = rows[:, quantities.owners == j]
        assert np.array_equal((own <= 0).all(axis=1), inside[:, j])
    jacobian = quantities.compute_jacobian(q)
    coordinates = Coordinates(mechanism)
    z = q[:, list(mechanism.independent)]
    for j, direction in enumerate(np.eye(mechanism.n_dof)):
        found = slope(
            lambda z: quantities.compute_rows(coordinates.compute_positions(z, q)), [z], direction
        )
        assert jacobian[:, :, j] == pytest.approx(found, rel=1e-5, abs=1e-7)


def test_distance_to_singularity_is_zero_where_far_links_line_up():
    mechanism = closed("five_bar")
    # Elbows so far apart that both far links lie on one line.
    half = np.arccos((0.45 - 0.15) / 0.35)
    q = np.array([np.pi - half, half - np.pi, half, -half])
    assert Coordinates(mechanism).compute_distance(q[None])[0] < 1e-8
    assert Coordinates(mechanism).compute_distance(mechanism.loops.assembly[None])[0] > 0.2


def test_a_turning_crank_stays_on_its_assembly_mode():
    mechanism = closed("four_bar")
    coordinates = Coordinates(mechanism)
    time = np.linspace(0, 4 * np.pi, 400)
    z = (mechanism.loops.assembly[0] + time)[:, None]
    q = coordinates.compute_positions(z, None)
    coordinates.check_motion(time, q)
    assert np.abs(np.diff(q[:, 1:], axis=0)).max() < 0.1
    assert q[199, 0] - q[0, 0] > 6


def test_a_rocker_driven_over_its_dead_point_is_refused():
    mechanism = closed("four_bar")
    driven = dataclasses.replace(mechanism.loops, independent=(2,))
    mechanism = dataclasses.replace(mechanism, loops=driven)
    z = driven.assembly[2] + np.linspace(0, 2.0, 50)
    with pytest.raises(DataError, match="singular configuration or to the end of its reach"):
        Coordinates(mechanism).compute_positions(z[:, None], None)


def test_follower_finds_what_a_fresh_start_finds():
    coordinates = Coordinates(closed("hexaglide"))
    follower = Follower(coordinates)
    basis = evaluate_basis(2 * np.pi, 2, sample_times(2 * np.pi, 40))
    rng = np.random.default_rng(0)
    for _ in range(5):
        coefficients = rng.normal(size=(6, 5)) * 0.01
        coefficients[:, 0] = 1.5
        z = basis.evaluate(coefficients)[0]
        found = follower(z)
        follower.keep()
        assert found == pytest.approx(coordinates.compute_positions(z, None), abs=1e-10)


def test_constraints_of_the_six_legged_robot_at_home():
    mechanism = closed("hexaglide")
    constraints = config_of("hexaglide").trajectories.build_constraints(mechanism)
    values = Quantities(mechanism, constraints).compute_values(mechanism.loops.assembly[None])[0]
    assert values[0] == pytest.approx(0, abs=1e-9)
    assert values[1:] == pytest.approx(np.full(6, 0.424), abs=1e-3)


EQUATIONS = {"fixed": 6, "revolute": 5, "prismatic": 5, "cylindrical": 4, "universal": 4, "point": 3,
             "planar": 2, "distance": 1, "coupling": 1}  # fmt: skip


TOOL = [0.3, -0.2, 0.25]


def chain_with(kind):
    """Seven hinges in space, the last body tied to the base, or its joint to the first one's."""
    rng = np.random.default_rng(5)
    q = rng.uniform(-1, 1, 7)
    bodies = [
        {"name": f"b{k}", "parent": f"b{k - 1}" if k else "base", "coordinates": f"q{k}",
         "axes": rng.normal(size=3).tolist(),
         "at": [{"xyz": rng.uniform(-0.5, 0.5, 3).tolist()}, {"rx": float(rng.uniform(-1, 1))}]}
        for k in range(7)
    ]  # fmt: skip
    inertia = {
        "m": 2.0,
        "com": [0.1, 0.05, -0.02],
        "inertia_com": [0.03, 1e-3, 2e-3, 0.04, 0, 0.05],
    }
    tree = {"bodies": bodies, "closures": [{"type": kind, "bodies": ["base", "b6"]}]}
    closure = tree["closures"][0]
    if kind == "coupling":
        closure |= {"bodies": ["b0", "b6"], "ratio": -2.0, "offset": float(q[6] + 2 * q[0])}
    else:
        open_tree = Description.model_validate({"tree": {"bodies": bodies}}).bodies
        mechanism = Mechanism("chain", open_tree.build_bodies(), (), np.zeros(3), (), ())
        pose = compute_body_poses(mechanism, q)[6] @ translate(*TOOL)
        angles = rotation_steps(pose[:3, :3])
        closure["at"] = [[{"xyz": pose[:3, 3].tolist()}, *angles], TOOL]
        if kind == "universal":  # y of the last body across x of the base's frame
            closure["at"] = [[{"xyz": pose[:3, 3].tolist()}, *angles, {"rx": 0.7}], TOOL]
        if kind == "distance":
            closure["at"] = [[0, 0, 0], TOOL]
            closure["length"] = float(np.linalg.norm(pose[:3, 3]))
    tree["independent"] = [f"q{k}" for k in range(7 - EQUATIONS[kind])]
    tree["guess"] = {f"q{k}": float(value) for k, value in enumerate(q)}
    sets = {"set": {f"b{k}": inertia for k in range(7)}}
    text = {"robot": "chain", "description": {"tree": tree}, "parameter_sets": sets}
    if kind != "coupling":  # depend shall what the equations determine best
        oracle = Lagrange(Robot.model_validate(text).build_mechanism())
        _, J, _ = oracle.closures(q, np.zeros(7))
        order = scipy.linalg.qr(np.array(J), mode="r", pivoting=True)[1]
        tree["independent"] = [f"q{k}" for k in sorted(order[EQUATIONS[kind] :])]
    return Robot.model_validate(text)


def rotation_steps(R):
    yaw, pitch, roll = (
        np.arctan2(R[1, 0], R[0, 0]),
        -np.arcsin(R[2, 0]),
        np.arctan2(R[2, 1], R[2, 2]),
    )
    return [{"rz": float(yaw)}, {"ry": float(pitch)}, {"rx": float(roll)}]


@pytest.mark.parametrize("kind", list(EQUATIONS))
def test_every_kind_of_closure_against_lagrange(kind):
    robot = chain_with(kind)
    mechanism = assemble(robot.build_mechanism())
    assert mechanism.n_dof == 7 - EQUATIONS[kind]
    oracle, phi = Lagrange(mechanism), robot.get_values()
    rng = np.random.default_rng(2)
    coordinates = Coordinates(mechanism)
    z0 = mechanism.loops.assembly[list(mechanism.independent)]
    z = z0 + rng.uniform(-0.02, 0.02, (5, mechanism.n_dof))
    q, dq, ddq = coordinates.compute_states(z, *rng.normal(size=(2, 5, mechanism.n_dof)))
    dynamics = Dynamics(mechanism, once=True)
    torques = dynamics.compute_torques(q, dq, ddq, phi)
    for k in range(5):
        gap, J, _ = (np.array(part) for part in oracle.closures(q[k], dq[k]))
        assert np.abs(gap).max() < 1e-11
        assert np.abs(J @ dq[k]).max() < 1e-10 * np.abs(J).max() * np.abs(dq[k]).max()
        R = tangent(oracle, mechanism.independent, q[k])
        expected = R.T @ np.array(oracle.tau(q[k], dq[k], ddq[k], phi)).ravel()
        assert torques[k] == pytest.approx(expected, rel=1e-8, abs=1e-8 * np.abs(expected).max())


def test_coupled_joints_add_up_their_columns():
    """Of the open chain, with R = d q / d z."""
    robot = chain_with("coupling")
    mechanism = assemble(robot.build_mechanism())
    states = Coordinates(mechanism).compute_states(*np.random.default_rng(0).normal(size=(3, 4, 6)))
    open_chain = dataclasses.replace(mechanism, loops=None)
    whole = Dynamics(open_chain, once=True).compute_regressor(*states)
    R = np.vstack([np.eye(6), [-2, 0, 0, 0, 0, 0]])
    expected = np.einsum("qz,kqn->kzn", R, whole)
    found = Dynamics(mechanism, once=True).compute_regressor(*states)
    assert found == pytest.approx(expected, rel=1e-10, abs=1e-10)


def test_equations_that_follow_from_others_are_dropped():
    """A hinge in space closes a plane four-bar with three equations too many."""
    closure = "{name: pin, type: revolute, bodies: [coupler, rocker], at: [[coupler, 0, 0], [rocker, 0, 0]]}"
    config = config_of("four_bar", f"description.tree.closures=[{closure}]")
    with pytest.warns(
        ParamreduceWarning, match=r"of the 5 equations .* 2 are independent; .*pin \(z\)"
    ):
        hinged = assemble(config.build_mechanism())
    assert len(hinged.loops.kept) == 2
    plane = closed("four_bar")
    states = states_of(plane)
    found, expected = (Dynamics(m, once=True).compute_regressor(*states) for m in (hinged, plane))
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())


def test_equations_that_are_needed_elsewhere_are_not_dropped():
    closure = "{name: pin, type: revolute, bodies: [coupler, rocker], at: [[coupler, 0, 0], [rocker, 0, 0]]}"
    mechanism = config_of("four_bar", f"description.tree.closures=[{closure}]").build_mechanism()
    here, there = np.zeros((2, 5, 3))
    here[0, 0] = here[1, 1] = there[0, 0] = there[2, 2] = 1.0
    with pytest.raises(NumericalError, match="not the same ones"):
        _choose_equations(mechanism, mechanism.loops, [here, there])
