"""Springs, dampers, bushings, tyres and contacts against vector mechanics, energies and power."""

import numpy as np
import pytest
from oracles import force_elements as oracle

from paramreduce_cli.config.loading import load_config
from paramreduce_cli.errors import ConfigError
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.kinematics import compute_body_poses
from paramreduce_cli.records import BASE, Kind

CONFIG = """
robot: sprung
description:
  gravity: [0, 0, -9.81]
  tree:
    bodies:
    - {name: chassis, joint: free, at: [0, 0, 0.5], coordinates: [x, y, z, rx, ry, rz]}
    - {name: arm, parent: chassis, axes: [1, 0.1, 0], at: [0.3, 0.2, -0.1], coordinates: a}
    - {name: carrier, parent: arm, axes: z, at: [0.1, 0.4, 0], coordinates: steer}
    - {name: wheel, parent: carrier, axes: y, at: [0, 0.1, 0], coordinates: spin}
    - {name: box, joint: free, at: [0.2, 0.1, 1.0], coordinates: [bx, by, bz, brx, bry, brz]}
parameter_sets:
  p:
    chassis: {m: 300, com: [0, 0, 0], inertia_com: [50, 1, 2, 100, 3, 120]}
    arm: {m: 10, com: [0, 0.2, 0], inertia_com: [0.5, 0, 0, 0.1, 0, 0.5]}
    carrier: {m: 8, com: [0.01, 0.02, 0.03], inertia_com: [0.1, 0, 0, 0.1, 0, 0.1]}
    wheel: {m: 20, com: [0, 0, 0], inertia_com: [0.5, 0, 0, 1, 0, 0.5]}
    box: {m: 30, com: [0.02, 0.01, 0], inertia_com: [1, 0, 0, 2, 0, 2.5]}
forces:
  strut:
    type: line
    bodies: [chassis, arm]
    at: [[0.3, 0.4, 0.4], [0, 0.3, 0.02]]
    stiffness: 30e3
    rest: 0.55
    viscous: 2000
    offset: 100
    coulomb: 30
    smoothing: 0.05
    damper_table: [[-1, -500], [-0.1, -200], [0, 0], [0.2, 600], [1, 1000]]
    spring_table: [[-0.1, -900], [0, 0], [0.1, 0], [0.2, 800]]
  mount:
    type: bushing
    bodies: [chassis, box]
    at: [[0.2, 0.1, 0.45], [{xyz: [0, 0, -0.05]}, {rz: 0.1}]]
    stiffness: [1e5, 2e5, 3e5, 500, 600, 700]
    viscous: [100, 200, 300, 5, 6, 7]
  tyre:
    type: tyre
    bodies: [base, carrier]
    at: [[0, 0, 0], [0, 0.1, 0]]
    radius: 0.32
    spin: spin
    stiffness: 2e5
    viscous: 300
    cornering: 5e4
    longitudinal: 6e4
    low_speed: 0.7
  light:
    type: tyre
    bodies: [base, carrier]
    at: [[0, 0, 0], [0, 0.1, 0]]
    radius: 0.3
    spring_table: [[-1, -1e5], [0, 0], [1, 0]]
  creep: {type: contact, motion: {y: 1, rz: 0.2}, positions: {rz: -1, y: 0.1}, speeds: {y: 0.05}, creep: 1e4}
nominal_torque: 1000
trajectories: {position_limits: [-0.3, 0.3], velocity_limits: 1}
"""
COUNT = 40


@pytest.fixture(scope="module")
def sprung(tmp_path_factory):
    path = tmp_path_factory.mktemp("sprung") / "sprung.yaml"
    path.write_text(CONFIG)
    config = load_config(path)
    return config.build_mechanism(), config.get_values()


@pytest.fixture(scope="module")
def states(sprung):
    rng = np.random.default_rng(3)
    shape = (COUNT, sprung[0].n_q)
    return 0.2 * rng.normal(size=shape), rng.normal(size=shape)


@pytest.fixture(scope="module")
def regressor(sprung, states):
    mechanism, _ = sprung
    q, dq = states
    return Dynamics(mechanism).compute_regressor(q, dq, np.zeros_like(q))


def column(mechanism, name):
    return mechanism.parameter_names.index(name)


def drive(mechanism, name):
    return next(d for d in mechanism.drives if d.name == name)


def assert_equal(got, expected):
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-9 * (1 + np.abs(expected).max()))


def test_a_line_is_a_pair_of_opposite_forces(sprung, states, regressor):
    mechanism, _ = sprung
    strut = drive(mechanism, "strut")
    for k, (q, dq) in enumerate(zip(*states, strict=True)):
        length, rate, needed = oracle.line(mechanism, q, dq, strut.between)
        spring = np.interp(length - 0.55, *strut.spring_table.T)
        if length - 0.55 < -0.1:
            spring = -900 + 9000 * (length - 0.45)
        elif length - 0.55 > 0.2:
            spring = 800 + 8000 * (length - 0.75)
        speeds, forces = strut.damper_table.T
        damper = np.interp(rate, speeds, forces)
        if abs(rate) > 1:
            slope, end = (500, 1000) if rate > 0 else (300 / 0.9, -500)
            damper = end + slope * (rate - np.sign(rate))
        expected = {
            "k": length - 0.55, "fv": rate, "off": 1.0, "fc": np.tanh(rate / 0.05), "ks": spring, "fd": damper,
        }  # fmt: skip
        for symbol, force in expected.items():
            assert_equal(regressor[k][:, column(mechanism, f"{symbol}_strut")], force * needed)


@pytest.mark.parametrize("axis", "xyz")
def test_a_bushing_pushes_along_the_axes_of_its_first_body(sprung, states, regressor, axis):
    mechanism, _ = sprung
    one = drive(mechanism, f"mount_{axis}")
    for k, (q, dq) in enumerate(zip(*states, strict=True)):
        position, rate, needed = oracle.shift(mechanism, q, dq, one.between)
        for symbol, force in (("k", position), ("fv", rate)):
            got = regressor[k][:, column(mechanism, f"{symbol}_mount_{axis}")]
            assert_equal(got, force * needed)


def compute_turn(mechanism, q, between):
    """The sine of the angle between the frames of a bushing, about an axis of the first."""
    poses = compute_body_poses(mechanism, q)
    A, B = (
        frame[:3, :3] if body == BASE else poses[body, :3, :3] @ frame[:3, :3]
        for body, frame in zip(between.bodies, between.frames, strict=True)
    )
    skew = (A.T @ B - B.T @ A) / 2
    return np.array([skew[2, 1], skew[0, 2], skew[1, 0]])[between.axis]


@pytest.mark.parametrize("axis", ["rx", "ry", "rz"])
def test_a_bushing_turns_back_along_the_gradient_of_its_energy(sprung, states, regressor, axis):
    mechanism, _ = sprung
    between = drive(mechanism, f"mount_{axis}").between
    h = 1e-5
    for k, (q, dq) in enumerate(zip(*states, strict=True)):
        moved = np.eye(q.size) * h
        slopes = np.array([
            (compute_turn(mechanism, q + m, between) - compute_turn(mechanism, q - m, between)) / (2 * h)
            for m in moved
        ])  # fmt: skip
        turn = compute_turn(mechanism, q, between)
        for symbol, force in (("k", turn), ("fv", slopes @ dq)):
            got = regressor[k][:, column(mechanism, f"{symbol}_mount_{axis}")]
            np.testing.assert_allclose(got, force * slopes, rtol=1e-7, atol=1e-8)


def test_a_tyre_has_the_forces_of_its_contact_point(sprung, states, regressor):
    mechanism, _ = sprung
    vertical, light = drive(mechanism, "tyre").between, drive(mechanism, "light")
    slipping = drive(mechanism, "tyre_slip").between
    for k, (q, dq) in enumerate(zip(*states, strict=True)):
        height, rate, needed = oracle.shift(mechanism, q, dq, vertical)
        slip, sideslip, rolling, across = oracle.wheel(mechanism, q, dq, slipping)
        expected = {
            "k_tyre": (height - 0.32) * needed,
            "fv_tyre": rate * needed,
            "ks_light": -1e5 * max(0.3 - height, 0.0) * needed,
            "C_tyre_sideslip": sideslip * across,
            "C_tyre_slip": slip * rolling,
        }
        for name, torques in expected.items():
            got = regressor[k][:, column(mechanism, name)]
            np.testing.assert_allclose(got, torques, rtol=1e-9, atol=1e-9)
    assert light.rest == 0.3


def test_a_contact_is_a_sum_of_positions_and_speeds(sprung, states, regressor):
    mechanism, _ = sprung
    names = mechanism.generalised_names
    q, dq = states
    y, rz = names.index("y"), names.index("rz")
    force = -q[:, rz] + 0.1 * q[:, y] + 0.05 * dq[:, y]
    got = regressor[:, :, column(mechanism, "C_creep")]
    assert_equal(got[:, y], force)
    assert_equal(got[:, rz], 0.2 * force)
    assert np.count_nonzero(np.abs(got).max(axis=0)) == 2


def test_dampers_take_the_power_of_the_square_of_their_speed(sprung, states, regressor):
    mechanism, _ = sprung
    measures = {"distance": oracle.line, "shift": oracle.shift}
    checked = 0
    for one in mechanism.drives:
        columns = mechanism.find_drive_columns(one)
        if one.between is None or one.between.kind not in measures or Kind.VISCOUS not in columns:
            continue
        for k, (q, dq) in enumerate(zip(*states, strict=True)):
            _, rate, _ = measures[one.between.kind](mechanism, q, dq, one.between)
            power = regressor[k][:, columns[Kind.VISCOUS]] @ dq
            assert power == pytest.approx(rate**2, rel=1e-9, abs=1e-12)
            checked += 1
    assert checked == 5 * COUNT


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("bodies: [chassis, arm]", "bodies: [chassis, arms]", "Did you mean arm?"),
        ("bodies: [chassis, arm]", "bodies: [arm, arm]", "acts between 'arm' and itself"),
        ("spin: spin", "spin: spun", "Did you mean spin?"),
        ("    spin: spin\n", "", "longitudinal needs spin"),
        ("  strut:\n", "  arm:\n", "'arm' is taken"),
        (
            "type: bushing",
            "type: bush",
            "forces.mount.type: unknown type 'bush'. Did you mean bushing?",
        ),
        (
            "    spin: spin\n",
            "    spins: spin\n",
            "forces.tyre.spins: unknown key 'spins'. Did you mean spin?",
        ),
        ("    radius: 0.3\n", "", "forces.light.radius is missing. It says: Radius without load"),
        ("[0.1, 0], [0.2, 800]", "[0.2, 0], [0.2, 800]", "must ascend"),
        ("positions: {rz: -1, y: 0.1}, speeds: {y: 0.05}, ", "", "has no creepage"),
    ],
)
def test_what_is_wrong_is_said(tmp_path, old, new, says):
    path = tmp_path / "sprung.yaml"
    assert CONFIG.count(old) >= 1
    path.write_text(CONFIG.replace(old, new))
    with pytest.raises(ConfigError, match="line") as caught:
        load_config(path)
    assert says in str(caught.value)


def test_a_line_along_one_axis_has_both_directions(tmp_path):
    path = tmp_path / "posts.yaml"
    path.write_text(
        """
robot: posts
description:
  tree:
    bodies:
      - {name: low, joint: prismatic, coordinates: a}
      - {name: high, joint: prismatic, coordinates: b}
parameter_sets: {p: {low: {m: 1}, high: {m: 2}}}
forces: {spring: {type: line, bodies: [low, high], at: [[0, 0, 0], [0, 0, 0]], stiffness: 10, rest: 0.3}}
nominal_torque: 1
trajectories: {position_limits: [-1, 1], velocity_limits: 1}
"""
    )
    mechanism = load_config(path).build_mechanism()
    q = np.array([[0.1, 0.7], [0.7, 0.1]])
    K = Dynamics(mechanism).compute_regressor(q, 0 * q, 0 * q)
    np.testing.assert_allclose(K[0, :, -1], [-0.3, 0.3])
    np.testing.assert_allclose(K[1, :, -1], [0.3, -0.3])


def test_names_of_parts_of_force_elements_are_their_own(tmp_path):
    path = tmp_path / "sprung.yaml"
    path.write_text(CONFIG.replace("  creep: {type", "  mount_z: {type"))
    with pytest.raises(ConfigError, match="a name that is taken"):
        load_config(path)
