"""MJCF files, against MuJoCo's own inverse dynamics."""

import contextlib
import importlib.util
from pathlib import Path

import numpy as np
import pytest

from paramreduce_cli.config import load_config
from paramreduce_cli.config.schema import SourceSection
from paramreduce_cli.errors import ConfigError
from paramreduce_cli.importing.config_writing import format_config
from paramreduce_cli.importing.source_reading import read_robot
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.assembly import assemble
from paramreduce_cli.multibody.loops.coordinates import Coordinates

mujoco = pytest.importorskip("mujoco")
mujoco.set_mju_user_warning(lambda _: None)  # which it writes to a file otherwise

ARM = """\
<mujoco model="an arm">
  <compiler angle="degree"/>
  <option gravity="0.3 -0.2 -9"/>
  <default><joint damping="0.3"/><default class="weak"><joint armature="0.02" frictionloss="0.4"/></default></default>
  <worldbody>
    <body name="post" pos="0 0 1" euler="0 30 0">
      <geom type="box" size="0.1 0.2 0.3" pos="0 0 0.1"/>
      <body name="upper" pos="0.1 0 0.2" quat="0.9 0.1 0.3 -0.2">
        <joint name="shoulder" axis="0 1 1" pos="0.05 -0.02 0.1" range="-90 60" limited="true" ref="20"/>
        <joint name="lift" type="slide" axis="0 0 -1" stiffness="30" springref="0.1" pos="0 0 0.2"/>
        <geom type="capsule" size="0.05" fromto="0 0 0 0.4 0 0"/>
        <body name="fore" pos="0.4 0 0">
          <inertial mass="0.7" pos="0.1 0.02 0" quat="1 0.2 0 0.1" diaginertia="0.01 0.02 0.025"/>
          <joint name="elbow" class="weak" axis="1 0 0" pos="0 0.1 0"/>
          <body name="fixed" pos="0.2 0 0" euler="45 0 0"><geom size="0.04"/></body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="elbow" gear="3" forcerange="-5 5" forcelimited="true"/>
    <motor joint="shoulder" forcerange="-50 50" forcelimited="true"/>
  </actuator>
</mujoco>
"""
BALLS = """\
<mujoco>
  <worldbody>
    <body name="float" pos="0 0 1">
      <freejoint/>
      <geom type="box" size="0.1 0.2 0.3" pos="0.1 0 0.1"/>
      <body name="swing" pos="0.2 0 0">
        <joint type="ball" pos="0.1 0 0"/><geom type="capsule" size="0.03" fromto="0 0 0 0.3 0.1 0"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
FIVE_BAR = """\
<mujoco>
  <default><geom type="capsule" size="0.02"/><joint axis="0 1 0"/></default>
  <worldbody>
    <body name="left"><joint name="left"/><geom fromto="0 0 0 0 0 0.3"/>
      <body name="left_rod" pos="0 0 0.3"><joint/><geom fromto="0 0 0 0.2 0 0.3"/></body>
    </body>
    <body name="right" pos="0.4 0 0"><joint name="right"/><geom fromto="0 0 0 0 0 0.3"/>
      <body name="right_rod" pos="0 0 0.3"><joint/><geom fromto="0 0 0 -0.2 0 0.3"/></body>
    </body>
    <body name="pointer" pos="0 0.3 0"><joint name="pointer" damping="0.1"/><geom fromto="0 0 0 0.1 0 0"/></body>
  </worldbody>
  <equality>
    <connect name="tip" body1="left_rod" body2="right_rod" anchor="0.2 0 0.3"/>
    <joint joint1="pointer" joint2="left" polycoef="0.1 -2 0 0 0"/>
  </equality>
  <actuator><motor joint="left"/><motor joint="right"/></actuator>
</mujoco>
"""


def written(tmp_path, text):
    path = tmp_path / "arm.xml"
    path.write_text(text)
    return path


def loaded(path, tmp_path, **choice):
    source = SourceSection(file=path, **choice)
    config = tmp_path / "config.yaml"
    config.write_text(format_config(read_robot(source), source))
    return load_config(config)


def mujoco_torques(path, states, friction=True):
    """Inverse dynamics without contacts and limits, dry friction by its definition."""
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    model.opt.density = model.opt.viscosity = 0
    model.body_gravcomp[:] = 0
    data, result = mujoco.MjData(model), []
    for data.qpos, data.qvel, data.qacc in zip(*states, strict=True):
        mujoco.mj_inverse(model, data)
        dry = model.dof_frictionloss * np.sign(data.qvel) if friction else 0
        result.append(data.qfrc_inverse + dry)
    return np.array(result)


def own_torques(config, states):
    return Dynamics(config.build_mechanism(), once=True).compute_torques(
        *states, config.get_values()
    )


def test_torques_are_those_of_mujoco(tmp_path):
    path = written(tmp_path, ARM)
    config = loaded(path, tmp_path)
    rng = np.random.default_rng(0)
    q, dq, ddq = rng.uniform(-2, 2, (3, 30, 3))
    reference = [np.radians(20), 0, 0]  # our coordinates count from the pose of the file
    expected = mujoco_torques(path, (q + reference, dq, ddq))
    assert own_torques(config, (q, dq, ddq)) == pytest.approx(expected, rel=1e-11, abs=1e-11)


def test_limits_and_drives_are_taken_over(tmp_path):
    path = written(tmp_path, ARM)
    config = loaded(path, tmp_path)
    assert config.robot == "an_arm"
    assert config.description.bodies.list_coordinates() == ["shoulder", "lift", "elbow"]
    limits = config.trajectories.build_limits(3)
    assert np.degrees([limits.lower[0], limits.upper[0]]) == pytest.approx([-110, 40], abs=1e-3)
    effects = {kind.symbol: value for kind, value in config.drives["elbow"].get_values().items()}
    assert effects == pytest.approx({"Ia": 0.02, "fv": 0.3, "fc": 0.4})
    warnings = " ".join(read_robot(SourceSection(file=path)).warnings)
    assert "shoulder counts from the pose of the file" in warnings
    assert config.nominal_torque == "standard-deviation"  # the lift has no actuator


def rates(q, dq):
    """Angular velocity in the body for turns about x, then y, then z."""
    (_, b, c), (u, v, w) = q, dq
    return np.array(
        [
            np.cos(b) * np.cos(c) * u + np.sin(c) * v,
            -np.cos(b) * np.sin(c) * u + np.cos(c) * v,
            np.sin(b) * u + w,
        ]
    )


def quaternion(q):
    result = np.array([1.0, 0, 0, 0])
    for axis, angle in zip(np.eye(3), q, strict=True):
        turn, product = np.zeros(4), np.zeros(4)
        mujoco.mju_axisAngle2Quat(turn, axis, angle)
        mujoco.mju_mulQuat(product, result, turn)
        result = product
    return result


def test_free_and_ball_joints_agree_with_mujoco(tmp_path):
    """By virtual work: MuJoCo has angular velocities where the config has rates of three angles."""
    path = written(tmp_path, BALLS)
    config = loaded(path, tmp_path)
    rng = np.random.default_rng(1)
    states = rng.uniform(-1, 1, (3, 10, 9))
    own = own_torques(config, states)

    def T(q):
        parts = [np.eye(3)]
        parts += [
            np.column_stack([rates(q[k : k + 3], unit) for unit in np.eye(3)]) for k in (3, 6)
        ]
        result = np.zeros((9, 9))
        for k, part in enumerate(parts):
            result[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = part
        return result

    for found, q, dq, ddq in zip(own, *states, strict=True):
        step = 1e-6
        drift = (T(q + step * dq) - T(q - step * dq)) @ dq / (2 * step)
        place = np.concatenate([q[:3] + np.array([0, 0, 1]), quaternion(q[3:6]), quaternion(q[6:])])
        tau = mujoco_torques(path, ([place], [T(q) @ dq], [T(q) @ ddq + drift]))[0]
        assert found == pytest.approx(T(q).T @ tau, rel=1e-7, abs=1e-7)


def test_equalities_become_closures(tmp_path):
    path = written(tmp_path, FIVE_BAR)
    config = loaded(path, tmp_path)
    tree = config.description.tree
    assert [(c.type, c.bodies) for c in tree.closures] == [
        ("coupling", ["left", "pointer"]),
        ("point", ["left_rod", "right_rod"]),
    ]
    assert tree.independent == ["left", "right"]
    with pytest.warns(match="follow from the others"):
        mechanism = assemble(config.build_mechanism())
    z = np.array([[0.05, -0.1]])
    q = Coordinates(mechanism).compute_positions(z, None)
    names = list(mechanism.generalised_names)
    assert q[0, names.index("pointer")] == pytest.approx(0.1 - 2 * 0.05)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.qpos = [
        q[0, names.index(name)] for name in ("left", "joint_1", "right", "joint_3", "pointer")
    ]
    mujoco.mj_forward(model, data)
    anchors = model.eq_data[0, :3], model.eq_data[0, 3:6]
    ends = [
        data.xpos[model.body(name).id] + data.xmat[model.body(name).id].reshape(3, 3) @ anchor
        for name, anchor in zip(("left_rod", "right_rod"), anchors, strict=True)
    ]
    assert ends[0] == pytest.approx(ends[1], abs=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("</worldbody>", "", "MuJoCo cannot compile it: XML parse error"),
        ('type="slide"', 'type="glide"', "line 10"),
        ('<geom size="0.04"/>', '<geom type="mesh" mesh="lost"/>', "lost"),
        ('axis="1 0 0"', 'axis="0 0 0"', "axis"),
        (
            "<actuator>",
            '<equality><joint joint1="lift" joint2="elbow" polycoef="0 1 1"/></equality><actuator>',
            "is a polynomial",
        ),
        (
            "<actuator>",
            '<equality><joint joint1="lift"/></equality><actuator>',
            "--lock lift=VALUE holds a joint",
        ),
        ("<mujoco model", "<mujocoinclude model", "give the file that includes it"),
    ],
)
def test_wrong_files_get_one_message(tmp_path, invoke, old, new, says):
    text = ARM.replace(old, new)
    text = text.replace("</mujoco>", "</mujocoinclude>") if "include" in new else text
    out = invoke("init", written(tmp_path, text), "--output", tmp_path / "arm.yaml", code=2)
    assert says in " ".join(out.err.split())
    assert not (tmp_path / "arm.yaml").exists()


def files():
    found = [importlib.util.find_spec(name) for name in ("dm_control", "gymnasium_robotics")]
    folders = [Path(spec.origin).parent for spec in found if spec is not None and spec.origin]
    paths = sorted(path for folder in folders for path in folder.rglob("*.xml"))
    return [path for path in paths if b"<mujoco" in path.read_bytes()]


@pytest.mark.skipif(not files(), reason="needs the dm-control and gymnasium-robotics wheels")
def test_every_mjcf_of_two_wheels_is_read_or_refused_with_a_message(tmp_path):
    read = 0
    for path in files():
        with contextlib.suppress(ConfigError):  # and nothing else
            loaded(path, tmp_path)
            read += 1
    assert read >= 64


@pytest.mark.skipif(not files(), reason="needs the dm-control and gymnasium-robotics wheels")
@pytest.mark.parametrize(
    "name", ["jaco_arm.xml", "cheetah.xml", "walker.xml", "adroit_door.xml", "rodent.xml"]
)
def test_torques_of_robots_are_those_of_mujoco(tmp_path, name):
    path = next(path for path in files() if path.name == name)
    model = mujoco.MjModel.from_xml_path(str(path))
    if (model.jnt_type < 2).any():
        pytest.skip("has joints of several coordinates, compared elsewhere")
    config = loaded(path, tmp_path, uncoupled=True)
    names = config.description.bodies.list_coordinates()
    order = [
        names.index(mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, k) or f"joint_{k}")
        for k in range(model.njnt)
    ]
    q, dq, ddq = np.random.default_rng(0).uniform(-1, 1, (3, 10, model.nv))
    expected = mujoco_torques(path, (q[:, order] + model.qpos0, dq[:, order], ddq[:, order]))
    found = own_torques(config, (q, dq, ddq))[:, order]
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())


def test_parameters_go_back_into_the_file(tmp_path, invoke):
    path, output = written(tmp_path, ARM), tmp_path / "arm.yaml"
    invoke("init", path, "--output", output)
    given = (output, "--results", tmp_path / "r")
    settings = [
        "parameter_sets.file.fore.m=0.9",
        "drives.elbow.viscous=0.7",
        "drives.elbow.inertia=0.05",
    ]
    invoke("build-model", *given, settings=settings)
    chosen = ("--format", "mjcf", "--model", "base", "--output", tmp_path / "out")
    invoke("export", *given, *chosen, settings=settings)
    assert "<actuator>" in (tmp_path / "out" / "arm.xml").read_text()
    again = loaded(tmp_path / "out" / "arm.xml", tmp_path)
    states = np.random.default_rng(0).uniform(-2, 2, (3, 20, 3))
    expected = own_torques(load_config(output, settings), states)
    assert own_torques(again, states) == pytest.approx(expected, rel=1e-9, abs=1e-9)
    old = own_torques(load_config(output), states)
    assert np.abs(expected - old).max() > 0.1


def test_mujoco_takes_physical_bodies_alone(tmp_path, invoke):
    path, output = written(tmp_path, ARM), tmp_path / "arm.yaml"
    invoke("init", path, "--output", output)
    given = (output, "--results", tmp_path / "r")
    settings = ["parameter_sets.file.fore.m=-0.9"]
    invoke("build-model", *given, settings=settings)
    model = ("--model", "full")
    out = invoke("export", *given, "--format", "mjcf", *model, settings=settings, code=2)
    assert "MuJoCo takes physical bodies alone" in " ".join(out.err.split())
    out = invoke("export", *given, "--format", "urdf", *model, settings=settings, code=2)
    assert "is not a URDF file" in " ".join(out.err.split())


def test_a_spring_goes_back_with_its_rest(tmp_path, invoke):
    path, output = written(tmp_path, ARM), tmp_path / "arm.yaml"
    invoke("init", path, "--output", output)
    settings = ["drives.shoulder={stiffness: 7, rest: 0.3}"]
    given = (output, "--results", tmp_path / "r")
    invoke("build-model", *given, settings=settings)
    chosen = ("--format", "mjcf", "--model", "full", "--output", tmp_path / "out")
    invoke("export", *given, *chosen, settings=settings)
    again = loaded(tmp_path / "out" / "arm.xml", tmp_path).drives["shoulder"]
    assert (again.stiffness, again.rest) == pytest.approx((7, 0.3))


def test_what_carries_others_must_be_physical_without_them(tmp_path, invoke):
    path, output = written(tmp_path, ARM), tmp_path / "arm.yaml"
    invoke("init", path, "--output", output)
    settings = ["parameter_sets.file.fore={m: 0.2}"]  # what is fixed to it weighs 0.27 kg
    given = (output, "--results", tmp_path / "r")
    invoke("build-model", *given, settings=settings)
    chosen = ("--format", "mjcf", "--model", "full")
    out = invoke("export", *given, *chosen, settings=settings, code=2)
    assert "without the links that move with it fore would have" in " ".join(out.err.split())


def test_bodies_without_a_name_get_one_that_is_free(tmp_path):
    text = (
        FIVE_BAR.replace('name="left_rod"', 'name="body_4"')
        .replace('name="right_rod"', "")
        .replace("left_rod", "body_4")
        .replace('body2="right_rod"', 'body2="right"')
    )
    config = loaded(written(tmp_path, text), tmp_path)
    assert "body_4_" in config.description.bodies.list_body_names()


def test_choices_that_would_change_loops_are_refused(tmp_path):
    path = written(tmp_path, FIVE_BAR)
    with pytest.raises(ConfigError, match="import it whole"):
        read_robot(SourceSection(file=path, locked={"left": 0.1}))
    opened = read_robot(SourceSection(file=path, ignored=["right"], uncoupled=True))
    assert len(opened.independent) == len(opened.bodies)


def test_a_model_without_a_name_is_called_after_its_file(tmp_path):
    text = ARM.replace(' model="an arm"', "").replace(
        'gravity="0.3 -0.2 -9"/>', 'gravity="0 0 -1"><flag gravity="disable"/></option>'
    )
    robot = read_robot(SourceSection(file=written(tmp_path, text)))
    assert robot.name == "arm"
    assert robot.gravity == (0, 0, 0)


def test_what_mujoco_warns_of_is_told_and_written_nowhere(tmp_path, invoke, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = ARM.replace('angle="degree"', 'angle="degree" settotalmass="5"')
    path, output = written(tmp_path, text), tmp_path / "arm.yaml"
    mujoco.set_mju_user_warning(None)
    try:
        warnings = read_robot(SourceSection(file=path)).warnings
        invoke("init", path, "--output", output)
        given = (output, "--results", tmp_path / "r")
        invoke("build-model", *given)
        invoke("export", *given, "--format", "mjcf", "--model", "full")
    finally:
        mujoco.set_mju_user_warning(lambda _: None)
    assert (
        any(warning.startswith("MuJoCo says:") for warning in warnings) or mujoco.__version__ < "4"
    )
    assert not (tmp_path / "MUJOCO_LOG.TXT").exists()


def test_a_file_of_another_gravity_or_another_kind_of_output_is_refused(tmp_path, invoke):
    path, output = written(tmp_path, ARM), tmp_path / "arm.yaml"
    invoke("init", path, "--output", output)
    given = (output, "--results", tmp_path / "r")
    settings = ["description.gravity=[0, 0, -1.62]"]
    invoke("build-model", *given, settings=settings)
    chosen = ("--format", "mjcf", "--model", "full")
    out = invoke("export", *given, *chosen, settings=settings, code=2)
    assert "has another gravity than the config" in " ".join(out.err.split())
    out = invoke("export", *given, *chosen, "--constants", settings=settings, code=2)
    assert "apply to code, not to --format mjcf" in " ".join(out.err.split())
