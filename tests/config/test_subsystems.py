"""Subsystems that are used mirrored, and named points."""

import numpy as np
import pytest

from paramreduce_cli.config.loading import load_config
from paramreduce_cli.errors import ConfigError
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.kinematics import compute_body_poses
from paramreduce_cli.multibody.loops.assembly import assemble

MIRRORED = """
robot: pair
constants: {{w: 0.4}}
subsystems:
  arm:
    points: {{foot: [0.1, w, 0.2, ], knee: [0.3, w + 0.5, 0.1], eye: [0.2, 0.7, 0.4]}}
    bodies:
      - {{name: thigh, parent: trunk, at: foot, axes: to knee}}
      - {{name: rod, parent: thigh, joint: prismatic, axes: [0.2, 0.5, -0.1], at: [{{xyz: [0.1, 0.2, 0.05]}}, {{rx: 0.3}}, {{ry: 0.2}}]}}
      - {{name: hand, parent: rod, axes: -{axis}, at: [0.05, "w/4", 0.02], coordinates: wrist}}
      - {{name: eyed, parent: trunk, joint: prismatic, axes: to knee, at: eye}}
    parameters:
      thigh: {{m: 3, com: knee, inertia_com: [0.2, 0.01, 0.02, 0.3, 0.03, 0.4]}}
      rod: {{m: 1, mx: 0.1, my: 0.2, mz: -0.1, Ixx: 0.3, Iyy: 0.4, Izz: 0.5, Ixy: 0.03, Ixz: -0.02, Iyz: 0.05}}
      hand: {{m: 0.5, com: [0.1, 0.03, 0.02], inertia_com: [[0.1, 0.01, 0], [0.01, 0.2, 0.02], [0, 0.02, 0.15]]}}
      eyed: {{m: 0.2}}
    drives:
      wrist: {{viscous: 0.3}}
      both: {{motion: {{q_thigh: 1, wrist: -2}}, stiffness: 4, rest: 0.1}}
    forces:
      spring: {{type: line, bodies: [trunk, hand], at: [eye, [0.1, 0.2, 0.3]], stiffness: 300, rest: 0.2, viscous: 20}}
uses:
  - {{subsystem: arm, suffix: _l}}
  - {{subsystem: arm, suffix: _r, mirror: y}}
description:
  tree: {{bodies: [{{name: trunk, joint: prismatic, axes: z, coordinates: height}}]}}
parameter_sets: {{p: {{trunk: {{m: 10}}}}}}
nominal_torque: 10
trajectories: {{position_limits: [-1, 1], velocity_limits: 1}}
"""


def load(tmp_path, text, **values):
    path = tmp_path / "config.yaml"
    path.write_text(text.format(**values))
    return load_config(path)


@pytest.mark.parametrize("axis", "xyz")
def test_a_mirrored_side_has_the_same_torques_at_the_same_coordinates(tmp_path, axis):
    config = load(tmp_path, MIRRORED, axis=axis)
    check_mirrored(config)
    names = config.build_mechanism().generalised_names
    assert names[1:5] == ("q_thigh_l", "q_rod_l", "wrist_l", "q_eyed_l")


def check_mirrored(config):
    """Both sides have the same torques at the same coordinates, and mirrored poses."""
    mechanism, values = config.build_mechanism(), config.get_values()
    rng = np.random.default_rng(1)
    n = (mechanism.n_q - 1) // 2
    left = rng.normal(size=(3, 20, n))
    trunk = rng.normal(size=(3, 20, 1))
    states = np.concatenate([trunk, left, left], axis=2)
    tau = Dynamics(mechanism).compute_torques(*states, values)
    np.testing.assert_allclose(tau[:, 1 : 1 + n], tau[:, 1 + n :], rtol=1e-11, atol=1e-11)
    assert np.abs(tau[:, 1:]).max() > 1
    poses = compute_body_poses(mechanism, states[0, 0])
    flip = np.diag([1.0, -1.0, 1.0])
    for k in range(1, 1 + n):
        np.testing.assert_allclose(poses[k + n, :3, 3], flip @ poses[k, :3, 3], atol=1e-12)
        np.testing.assert_allclose(poses[k + n, :3, :3], flip @ poses[k, :3, :3] @ flip, atol=1e-12)


def test_points_are_in_the_base_frame_while_all_coordinates_are_zero(tmp_path):
    config = load(tmp_path, MIRRORED, axis="x")
    mechanism = config.build_mechanism()
    poses = compute_body_poses(mechanism, np.zeros(mechanism.n_q))
    names = [body.name for body in mechanism.bodies]
    np.testing.assert_allclose(poses[names.index("thigh_l"), :3, 3], [0.1, 0.4, 0.2])
    thigh = mechanism.bodies[names.index("thigh_l")].parent_to_joint[:3, 2]
    np.testing.assert_allclose(thigh, np.array([0.2, 0.5, -0.1]) / np.sqrt(0.3))
    values = dict(zip(mechanism.parameter_names, config.get_values(), strict=True))
    assert values["mx_thigh_l"] == pytest.approx(3 * 0.2)
    assert values["my_thigh_l"] == pytest.approx(-values["my_thigh_r"])


LOOP = """
robot: loop
description:
  tree:
    points: {{A: [0, 0, 0], B: [0, 0, 0.5], C: [1, 0, 0.7], D: [1.2, 0, 0]}}
    bodies:
      - {{name: crank, at: A, axes: y}}
      - {{name: rod, parent: crank, at: B, axes: y}}
      - {{name: rocker, at: D, axes: y}}
    closures: [{{type: {kind}, bodies: [rod, rocker], at: {at}}}]
    independent: [{independent}]
parameter_sets: {{p: {{crank: {{m: 1, com: B}}, rod: {{m: 1, com: C}}, rocker: {{m: 1, com: C}}}}}}
trajectories: {{position_limits: [-1, 1], velocity_limits: 1}}
"""


def test_loops_are_closed_where_all_coordinates_are_zero(tmp_path):
    config = load(tmp_path, LOOP, kind="point", at="C", independent="q_crank")
    with pytest.warns(match="of the 3 equations"):
        assert not assemble(config.build_mechanism()).loops.assembly.any()


def test_a_rod_between_two_points_is_as_long_as_they_are_apart(tmp_path):
    config = load(tmp_path, LOOP, kind="distance", at="[C, B]", independent="q_crank, q_rod")
    (closure,) = config.build_mechanism().loops.closures
    assert closure.length == pytest.approx(np.hypot(1, 0.2))


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ("at: foot", "at: fot", 8, "unknown point 'fot'"),
        ("subsystem: arm, suffix: _l", "subsystem: ram, suffix: _l", 23, "unknown subsystem 'ram'"),
        (
            "suffix: _r",
            "suffix: _l",
            24,
            "'foot_l' of 'foot', which description.tree.points has already",
        ),
        ("joint: prismatic, axes: to knee", "joint: prismatic, axes: to eye", 11, "no direction"),
        ("stiffness: 4", "stiffnes: 4", 19, "subsystems.arm.drives.both.stiffnes"),
        ("m: 0.5, com", "m: half, com", 15, "subsystems.arm.parameters.hand.m"),
        ("mirror: y", "mirror: w", 24, "'x', 'y' or 'z'"),
    ],
)
def test_what_is_wrong_names_the_line_of_the_subsystem(tmp_path, old, new, line, says):
    assert MIRRORED.count(old) == 1
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, MIRRORED.replace(old, new), axis="x")
    assert f"line {line}: " in str(caught.value)
    assert says in str(caught.value)


def test_a_setting_reaches_one_side_alone(tmp_path):
    path = tmp_path / "config.yaml"
    path.write_text(MIRRORED.format(axis="x"))
    values = {}
    for overrides in ([], ["parameter_sets.p.hand_r.m=0.7"]):
        config = load_config(path, overrides)
        names = config.build_mechanism().parameter_names
        values[len(overrides)] = dict(zip(names, config.get_values(), strict=True))
    changed = {name for name, value in values[0].items() if value != values[1][name]}
    assert {"m_hand_r", "mx_hand_r"} <= changed
    assert all(name.endswith("hand_r") for name in changed)


@pytest.mark.parametrize("joint", ["revolute", "prismatic", "universal"])
def test_joints_without_axes_are_mirrored_too(tmp_path, joint):
    body = "{{name: rod, parent: thigh, joint: prismatic, axes: [0.2, 0.5, -0.1], "
    text = MIRRORED.replace(body, f"{{{{name: rod, parent: thigh, joint: {joint}, ")
    check_mirrored(load(tmp_path, text, axis="x"))


def test_default_coordinates_of_several_axes_are_renamed(tmp_path):
    body = "{{name: rod, parent: thigh, joint: prismatic, axes: [0.2, 0.5, -0.1], "
    text = MIRRORED.replace(body, "{{name: rod, parent: thigh, joint: universal, ")
    text = text.replace("motion: {{q_thigh: 1, wrist: -2}}", "motion: {{q_rod_2: 1}}")
    mechanism = load(tmp_path, text, axis="x").build_mechanism()
    weights = {d.name: np.flatnonzero(d.weights).tolist() for d in mechanism.drives}
    names = mechanism.generalised_names
    assert weights["both_l"] == [names.index("q_rod_l_2")]
    assert weights["both_r"] == [names.index("q_rod_r_2")]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("uses:\n  - {{subsystem: arm, suffix: _l}}\n  - {{subsystem: arm, suffix: _r, mirror: y}}\n",
         "", "are not used"),
        ("knee: [0.3, w + 0.5, 0.1]", "knee: [0.3, w + 0.5]", "must be three numbers"),
        ("    drives:\n", "    independent: 5\n    drives:\n", "independent"),
    ],
)  # fmt: skip
def test_parts_of_another_form_are_said(tmp_path, old, new, says):
    assert MIRRORED.count(old) == 1
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, MIRRORED.replace(old, new), axis="x")
    assert says in str(caught.value)


def test_groups_are_those_of_the_same_role(tmp_path):
    text = MIRRORED + "reduction: {{groups: auto}}\n"
    text = text.replace(
        "    forces:\n",
        "    forces:\n      mount: {{type: bushing, bodies: [trunk, thigh], at: foot, stiffness: [1, 2, 3, 0, 0, 0]}}\n",
    )
    config = load(tmp_path, text, axis="x")
    groups = {group.name: group.parameters for group in config.reduction.groups}
    assert groups["Ixy_arm_thigh"] == ["Ixy_thigh_l", "Ixy_thigh_r"]
    assert groups["k_arm_both"] == ["k_both_l", "k_both_r"]
    assert groups["k_arm_mount_y"] == ["k_mount_l_y", "k_mount_r_y"]
    grouped = {name for members in groups.values() for name in members}
    left = set(config.build_mechanism().parameter_names) - grouped
    assert all(name.endswith("_trunk") for name in left)


def test_groups_of_uses_need_uses(tmp_path):
    text = LOOP + "reduction: {{groups: auto}}\n"
    with pytest.raises(ConfigError, match="no subsystem is used twice"):
        load(tmp_path, text, kind="point", at="C", independent="q_crank")


SHIFTED = MIRRORED.replace(
    "  - {{subsystem: arm, suffix: _r, mirror: y}}\n",
    "  - {{subsystem: arm, suffix: _r, shift: [1.5, 0.1, w], names: {{trunk: tail}}, mirror: y}}\n",
).replace(
    "coordinates: height}}]}}",
    "coordinates: height}}, {{name: tail, parent: trunk, at: [0.5, 0, 0], axes: z}}]}}",
)


def test_a_use_may_be_elsewhere_on_another_body(tmp_path):
    config = load(tmp_path, SHIFTED.replace("{{trunk: {{m: 10}}", "{{trunk: {{m: 10}}, tail: {{m: 1}}"), axis="x")  # fmt: skip
    mechanism = config.build_mechanism()
    names = [body.name for body in mechanism.bodies]
    parents = {b.name: names[b.parent] if b.parent >= 0 else "base" for b in mechanism.bodies}
    assert (parents["thigh_l"], parents["thigh_r"]) == ("trunk", "tail")
    poses = compute_body_poses(mechanism, np.zeros(mechanism.n_q))
    np.testing.assert_allclose(poses[names.index("thigh_r"), :3, 3], [1.6, -0.5, 0.6])
    np.testing.assert_allclose(poses[names.index("eyed_r"), :3, 3], [1.7, -0.8, 0.8])
    (spring,) = [d for d in mechanism.drives if d.name == "spring_r"]
    assert names[spring.between.bodies[0]] == "tail"


def test_a_shift_has_three_components(tmp_path):
    with pytest.raises(ConfigError, match="at least 3 items"):
        load(tmp_path, SHIFTED.replace("[1.5, 0.1, w]", "[1.5, 0.1]"), axis="x")


def test_a_use_without_a_subsystem_is_said(tmp_path):
    with pytest.raises(ConfigError, match=r"uses\.0\.subsystem"):
        load(tmp_path, MIRRORED.replace("subsystem: arm, suffix: _l", "suffix: _l"), axis="x")


def test_a_name_for_nothing_is_said(tmp_path):
    text = SHIFTED.replace("names: {{trunk: tail}}", "names: {{frame: tail}}")
    with pytest.raises(ConfigError, match=r"refers to no 'frame' outside"):
        load(tmp_path, text, axis="x")
