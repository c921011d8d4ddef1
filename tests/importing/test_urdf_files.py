"""URDF files: what is read, merged and written, against Pinocchio; and what is refused."""

import contextlib
import re
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from robot_files import ARM

from paramreduce_cli.config import load_config
from paramreduce_cli.config.schema import SourceSection
from paramreduce_cli.errors import ConfigError
from paramreduce_cli.importing.config_writing import format_config
from paramreduce_cli.importing.source_reading import read_robot
from paramreduce_cli.importing.urdf_files import read_urdf
from paramreduce_cli.multibody.base_parameters import choose_base, find_affecting_columns
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.assembly import assemble
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.random_states import draw_states
from paramreduce_cli.records import INERTIAL
from paramreduce_cli.robots.drives import DriveSection

pin = pytest.importorskip("pinocchio")
ROBOTS = next(Path(sys.prefix).rglob("share/example-robot-data/robots"), None)
needs_robots = pytest.mark.skipif(ROBOTS is None, reason="needs the example-robot-data wheel")


def written(tmp_path, text):
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    return path


def loaded(path, tmp_path, **choice):
    config = tmp_path / "config.yaml"
    source = SourceSection(file=path, **choice)
    config.write_text(format_config(read_robot(source), source))
    return load_config(config)


def pinocchio_torques(model, states):
    """By RNEA with the file's friction on top; a continuous joint has its angle alone here, cosine and sine there."""
    data, result = model.createData(), []
    for q, dq, ddq in zip(*states, strict=True):
        full = np.concatenate(
            [[np.cos(x), np.sin(x)] if joint.nq == 2 else [x]
             for x, joint in zip(q, model.joints[1:], strict=True)]
        )  # fmt: skip
        friction = model.upperDryFrictionLimit * np.sign(dq) + model.damping * dq
        result.append(pin.rnea(model, data, full, dq, ddq) + friction)
    return np.array(result)


def own_torques(config, states):
    return Dynamics(config.build_mechanism(), once=True).compute_torques(
        *states, config.get_values()
    )


def states_of(n, count=20):
    rng = np.random.default_rng(0)
    return tuple(rng.uniform(-2, 2, (count, n)) for _ in range(3))


def test_torques_are_those_of_pinocchio(tmp_path):
    path = written(tmp_path, ARM)
    config = loaded(path, tmp_path)
    model, states = pin.buildModelFromUrdf(str(path)), states_of(3)
    expected = pinocchio_torques(model, states)
    assert own_torques(config, states) == pytest.approx(expected, rel=1e-11, abs=1e-11)


@pytest.mark.parametrize("locked", [{"shoulder": 0.7}, {'j"lift': 0.2}, {"grip": -1.1}])
def test_locked_joints_are_part_of_what_carries_them(tmp_path, locked):
    path = written(tmp_path, ARM)
    config = loaded(path, tmp_path, locked=locked)
    whole = pin.buildModelFromUrdf(str(path))
    ((name, value),) = locked.items()
    held, q = whole.getJointId(name), pin.neutral(whole)
    joint = whole.joints[held]
    q[joint.idx_q : joint.idx_q + joint.nq] = [np.cos(value), np.sin(value)][: joint.nq]
    if joint.nq == 1:
        q[joint.idx_q] = value
    states = states_of(2)
    expected = pinocchio_torques(pin.buildReducedModel(whole, [held], q), states)
    assert own_torques(config, states) == pytest.approx(expected, rel=1e-10, abs=1e-10)


def test_names_limits_and_torques_are_taken_over(tmp_path):
    path = written(tmp_path, ARM)
    config = loaded(path, tmp_path)
    assert config.robot == "an_arm"
    assert config.description.bodies.list_coordinates() == ["shoulder", "j_lift", "grip"]
    limits = config.trajectories.build_limits(3)
    assert limits.lower == pytest.approx([-2, 0, -np.pi])
    assert limits.upper == pytest.approx([1.5, 0.3, np.pi])
    assert limits.velocity == pytest.approx([3, 0.5, 1.5])
    assert config.nominal_torque == "standard-deviation"  # grip has no effort
    warnings = " ".join(read_robot(SourceSection(file=path)).warnings)
    assert "the joint 'j\"lift' is called j_lift here" in warnings


def test_a_chain_a_branch_left_out_and_another_root(tmp_path):
    path = written(tmp_path, ARM)
    names = [
        loaded(path, tmp_path, **choice).description.bodies.list_body_names()
        for choice in ({"tip": "1"}, {"ignored": ("slide",)}, {"root": "1"}, {"floating": True})
    ]
    assert names == [
        ["upper"],
        ["upper"],
        ["slide", "finger"],
        ["world", "upper", "slide", "finger"],
    ]


def following(old, *more):
    """The arm whose slide follows its shoulder, and more changes."""
    text = ARM.replace(
        'upper="0.3" velocity="0.5" effort="100"/>',
        f'upper="0.3" velocity="0.5" effort="100"/>{old}',
    )
    for before, after in more:
        assert before in text
        text = text.replace(before, after)
    return text


def test_a_joint_that_follows_another_adds_its_torque_to_it(tmp_path):
    path = written(tmp_path, following('<mimic joint="shoulder" multiplier="-0.5" offset="0.1"/>'))
    config = loaded(path, tmp_path)
    assert config.description.bodies.list_independent_coordinates() == ["shoulder", "grip"]
    mechanism = assemble(config.build_mechanism())
    z, dz, ddz = states_of(2)
    S, offset = np.array([[1, 0], [-0.5, 0], [0, 1]]), np.array([0, 0.1, 0])
    model = pin.buildModelFromUrdf(str(written(tmp_path, ARM)))
    expected = pinocchio_torques(model, (z @ S.T + offset, dz @ S.T, ddz @ S.T)) @ S
    states = Coordinates(mechanism).compute_states(z, dz, ddz)
    found = Dynamics(mechanism, once=True).compute_torques(*states, config.get_values())
    assert found == pytest.approx(expected, rel=1e-10, abs=1e-10)


def test_a_joint_that_follows_none_moves_on_its_own(tmp_path):
    robot = read_robot(SourceSection(file=written(tmp_path, following('<mimic joint="lost"/>'))))
    assert not robot.couplings
    assert "j\"lift follows 'lost', which is no joint: it moves on its own" in robot.warnings


def test_joints_that_follow_one_that_follows_or_does_not_move(tmp_path):
    grip = (
        '<axis xyz="0.6 0 0.8"/>',
        '<axis xyz="0.6 0 0.8"/><mimic joint="j&quot;lift" multiplier="3"/>',
    )
    slide = '<mimic joint="shoulder" multiplier="2" offset="0.1"/>'
    path = written(tmp_path, following(slide, grip))
    robot = read_robot(SourceSection(file=path))
    assert [(c.leader.name, c.ratio, c.offset) for c in robot.couplings] == [
        ("upper", 2.0, 0.1), ("upper", 6.0, pytest.approx(0.3)),
    ]  # fmt: skip
    with pytest.raises(ConfigError, match="no joint is left that moves"):
        read_robot(SourceSection(file=path, locked={"shoulder": 0.3}))
    assert loaded(path, tmp_path, uncoupled=True).n_dof == 3


def test_planar_and_floating_joints(tmp_path):
    planar = ARM.replace('name="shoulder" type="revolute"', 'name="shoulder" type="planar"')
    config = loaded(written(tmp_path, planar), tmp_path)
    assert config.n_dof == 5
    floating = ARM.replace('name="shoulder" type="revolute"', 'name="shoulder" type="floating"')
    path = written(tmp_path, floating)
    assert loaded(path, tmp_path).n_dof == 8


def test_rounded_angles_are_listed(tmp_path):
    path = written(tmp_path, ARM.replace('rpy="0 1.2 0"', 'rpy="0 1.5708 3.14159"'))
    robot = read_robot(SourceSection(file=path))
    assert [r for r in robot.warnings if "1.5708" in r or "3.14159" in r]
    assert "{rz: pi}, {ry: pi/2}" in format_config(robot, SourceSection(file=path))


@needs_robots
@pytest.mark.parametrize("floating", [False, True])
@pytest.mark.parametrize(
    ("file", "kept", "fixed_counts", "floating_counts"),
    [
        ("panda_description/urdf/panda.urdf", 9, (90, 79, 51), (100, 100, 67)),
        ("panda_description/urdf/panda.urdf", 7, (70, 59, 43), (80, 80, 59)),
        ("ur_description/urdf/ur10_robot.urdf", 6, (60, 51, 36), (70, 70, 52)),
        ("kinova_description/robots/kinova.urdf", 6, (60, 51, 36), (70, 70, 52)),
        ("so_arm_description/urdf/so101.urdf", 6, (60, 51, 36), (70, 70, 52)),
        ("talos_data/robots/talos_left_arm.urdf", 7, (70, 62, 45), (80, 80, 59)),
        ("solo_description/robots/solo12.urdf", 12, (120, 92, 68), (130, 130, 94)),
    ],
)  # fmt: skip
def test_base_counts_of_robots(tmp_path, file, kept, fixed_counts, floating_counts, floating):
    """Counts by Pinocchio's regressor on the nominal angles."""
    robot = read_urdf(ROBOTS / file)
    moving = [joint.name for joint in robot.joints if joint.kind != "fixed"]
    locked = dict.fromkeys(moving[kept:], 0.0)
    choice = {"locked": locked, "floating": floating, "uncoupled": True}
    config = loaded(ROBOTS / file, tmp_path, **choice)
    mechanism = config.build_mechanism()
    states = draw_states(mechanism, 150, np.random.default_rng(0))
    K = Dynamics(mechanism, once=True).compute_regressor(*states)
    W = K.reshape(-1, K.shape[2])
    W = W[:, [parameter.kind in INERTIAL for parameter in mechanism.parameters]]
    base = choose_base(W, mechanism.preference_order[mechanism.preference_order < W.shape[1]], 1e-8)
    found = (W.shape[1], int(find_affecting_columns(W).sum()), base.columns.size)
    assert found == (floating_counts if floating else fixed_counts)


@needs_robots
@pytest.mark.parametrize(
    "file", ["panda_description/urdf/panda.urdf", "kinova_description/robots/kinova.urdf",
             "talos_data/robots/talos_left_arm.urdf", "anymal_c_simple_description/urdf/anymal.urdf"],
)  # fmt: skip
def test_torques_of_robots(tmp_path, file):
    config = loaded(ROBOTS / file, tmp_path, uncoupled=True)
    model = pin.buildModelFromUrdf(str(ROBOTS / file))
    names = config.description.bodies.list_coordinates()
    order = [model.names.tolist().index(name) - 1 for name in names]
    states = states_of(model.njoints - 1)
    own = own_torques(config, [some[:, order] for some in states])
    expected = pinocchio_torques(model, states)[:, order]
    assert own == pytest.approx(expected, rel=1e-9, abs=1e-9)


@needs_robots
def test_every_robot_of_the_wheel_is_read_or_refused_with_a_message(tmp_path):
    files, refused = sorted(ROBOTS.rglob("*.urdf")), {}
    for file in files:
        try:
            loaded(file, tmp_path)
        except ConfigError as error:
            refused[file.name] = str(error)
    assert len(files) - len(refused) >= 66
    assert set(refused) <= {"quadrotor_base.urdf", "iris_simple.urdf", "ur3.urdf"}
    assert all(str(ROBOTS) in message for message in refused.values())


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("</robot>", "", "line 29: is no XML"),
        ("<robot", '<!DOCTYPE robot [<!ENTITY a "b">]><robot', "declares a document type"),
        ("<robot", "<sdf", "is no XML"),
        ('child link="finger"', 'child link="thumb"', "has the child 'thumb', which is no link"),
        ('type="prismatic"', 'type="screw"', "has type='screw'; known are revolute"),
        ('<axis xyz="0.6 0 0.8"/>', '<axis xyz="0 0 0"/>', "has an axis without a direction"),
        ('lower="-2" upper="1.5"', 'lower="2" upper="1.5"', "lower limit 2 above its upper 1.5"),
        ('<mass value="2.5"/>', '<mass value="heavy"/>', "has value='heavy'; a number should stand there"),
        ('<mass value="2.5"/>', "", "needs <mass> and <inertia>"),
        ('xyz="0.1 0.02 -0.03"', 'xyz="0.1 0.02"', "3 numbers should stand there"),
        ('xyz="0.1 0.02 -0.03"', 'xyz="${x} 0 0"', "is xacro that was not expanded"),
        ('<link name="slide">', '<link name="upper">', "is listed twice"),
        ('<parent link="world"/><child link="post"/>', '<parent link="world"/><child link="slide"/>', "a URDF is a tree"),
        ('<parent link="world"/><child link="post"/>', '<parent link="finger"/><child link="post"/>', "closes a circle"),
        ('<link name="world"/>', '<link name="world"/><link name="lost"/>', "no joint carries world, lost"),
        ('<link name="world"/>', "<link/>", "has no name"),
        ('effort="50"/>', 'effort="50"/><mimic joint="shoulder"/>', "mimics itself in a circle"),
    ],
)  # fmt: skip
def test_wrong_files_get_one_message(tmp_path, invoke, old, new, says):
    assert old in ARM
    path = written(tmp_path, ARM.replace(old, new, 1))
    output = tmp_path / "out.yaml"
    refused = invoke("init", path, "--output", output, code=2)
    message = " ".join(refused.err.split())
    assert says in message
    assert str(path) in message.replace(" ", "") or str(path) in message
    assert not output.exists()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--tip", "thumb"], "--tip thumb"),
        (["--root", "finger"], "no joint is left that moves"),
        (["--lock", "shoulder"], "write JOINT=VALUE"),
        (["--lock", "0.5"], "write JOINT=VALUE"),
        (["--lock", "knee=1"], "--lock knee"),
        (["--ignore", "hand"], "--ignore hand"),
        (["--root", "slide", "--tip", "upper"], "is not carried by the root slide"),
    ],
)
def test_wrong_choices_get_one_message(tmp_path, invoke, options, says):
    path = written(tmp_path, ARM)
    assert says in " ".join(invoke("init", path, *options, code=2).err.split())


def test_init_writes_a_config_that_builds(tmp_path, invoke):
    path, output = written(tmp_path, ARM), tmp_path / "arm.yaml"
    out = invoke("init", path, "--output", output).out
    assert f"paramreduce run {output}" in " ".join(out.split())
    invoke("build-model", output, "--results", tmp_path / "r")
    assert "exists already" in invoke("init", path, "--output", output, code=2).err


PIECES = ["<", ">", '"', "=", "0", "-", "nan", "inf", "1e999", "<link", "</joint>", "name", "mimic", "é", "\x00",
          "&a;", "<!--", "]]>", "parent", "base", " ", "1.5708", "<joint/>", "<link name='base'/>"]  # fmt: skip


@settings(
    deadline=None, max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    st.lists(
        st.tuples(st.integers(0, len(ARM)), st.integers(0, 40), st.sampled_from(PIECES)),
        min_size=1,
        max_size=4,
    )
)
def test_whatever_a_file_holds_it_is_read_or_refused_with_a_message(tmp_path, changes):
    text = ARM
    for start, length, piece in changes:
        text = text[:start] + piece + text[start + length :]
    with contextlib.suppress(ConfigError):
        loaded(written(tmp_path, text), tmp_path)


def test_parameters_go_back_into_the_file(tmp_path, invoke):
    """The reduced model's torques, from the file that is written and read anew."""
    path = written(tmp_path, "<?xml version='1.0'?>\n<!-- kept -->\n" + ARM)
    output = tmp_path / "arm.yaml"
    invoke("init", path, "--output", output)
    settings = ["trajectories.count=2", "trajectories.test_count=1", "trajectories.starts=2", "trajectories.polished=1", "selected.torque_error=0.1",
                "validation.accept={}", "validation.stability=false", "reduction.heuristics=[forward-selection]", "report.formats=[svg]", "drives.grip.inertia=0.1"]  # fmt: skip
    given = (output, "--results", tmp_path / "r")
    invoke("run", *given, settings=settings)
    own = load_config(output, settings)
    mechanism, states = own.build_mechanism(), states_of(3)
    with h5py.File(tmp_path / "r" / "reduction.h5") as file:
        found = file["forward-selection"]
        reduced = np.zeros(mechanism.n_parameters)
        reduced[found["subsets/5"][()]] = found["parameters/5"][()]
    models = {"full": own.get_values(), "base": own.get_values()}
    for model, phi in (models | {"forward-selection:5": reduced}).items():
        chosen = ("--format", "urdf", "--model", model, "--output", tmp_path / model)
        said = invoke("export", *given, *chosen, settings=settings).err
        again = tmp_path / model / "arm.urdf"
        assert "<!-- kept -->" in again.read_text()
        config = loaded(again, tmp_path / model)
        (rotor,) = re.findall(r"no place for it: Ia_grip = (\S+)\.", " ".join(said.split()))
        drives = config.drives | {"grip": DriveSection(inertia=float(rotor))}
        config = config.model_copy(update={"drives": drives})
        expected = Dynamics(mechanism, once=True).compute_torques(*states, phi)
        assert own_torques(config, states) == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_a_file_that_is_another_robot_now_is_not_written(tmp_path, invoke):
    path, output = written(tmp_path, ARM), tmp_path / "arm.yaml"
    invoke("init", path, "--output", output)
    given = (output, "--results", tmp_path / "r")
    chosen = ("--format", "urdf", "--model", "full")
    invoke("build-model", *given)
    written(tmp_path, ARM.replace('xyz="0.4 0 0"', 'xyz="0.5 0 0"'))
    out = invoke("export", *given, *chosen, code=2)
    assert "its bodies are not those of the config" in " ".join(out.err.split())
    path.unlink()
    assert "is no file" in invoke("export", *given, *chosen, code=2).err


def test_a_config_of_no_file_cannot_be_written_back(invoke, tmp_path):
    config = Path(__file__).parents[2] / "configs" / "two_link.yaml"
    invoke("build-model", config, "--results", tmp_path)
    out = invoke(
        "export", config, "--results", tmp_path, "--format", "urdf", "--model", "full", code=2
    )
    assert "names no robot file" in " ".join(out.err.split())


def test_friction_behind_a_gear_goes_back_as_the_joint_sees_it(tmp_path, invoke):
    """Also where the coordinate was renamed; what the config has no longer is gone from the file."""
    path, output = written(tmp_path, ARM), tmp_path / "arm.yaml"
    invoke("init", path, "--output", output)
    text = output.read_text().replace("coordinates: shoulder", "coordinates: q1")
    drives = "  motor: {motion: {q1: -100}, viscous: 1e-4, coulomb: 4e-3}\n"
    output.write_text(re.sub(r"  shoulder: {visc.*\n", drives, text))
    given = (output, "--results", tmp_path / "r")
    chosen = ("--format", "urdf", "--model", "full", "--output", tmp_path / "out")
    invoke("build-model", *given)
    invoke("export", *given, *chosen)
    again = loaded(tmp_path / "out" / "arm.urdf", tmp_path).drives["shoulder"]
    assert (again.viscous, again.coulomb) == pytest.approx((1.0, 0.4))
    output.write_text(re.sub(r"drives:\n(  .*\n)+", "", output.read_text()))
    invoke("build-model", *given)
    invoke("export", *given, *chosen)
    assert not loaded(tmp_path / "out" / "arm.urdf", tmp_path).drives


def test_another_axis_is_another_robot(tmp_path, invoke):
    path, output = written(tmp_path, ARM), tmp_path / "arm.yaml"
    invoke("init", path, "--output", output)
    output.write_text(output.read_text().replace("axes: -z", "axes: -x"))
    given = (output, "--results", tmp_path / "r")
    invoke("build-model", *given)
    out = invoke("export", *given, "--format", "urdf", "--model", "full", code=2)
    assert "its bodies are not those of the config" in " ".join(out.err.split())


def test_followers_of_a_fixed_joint_and_negative_speeds_are_said(tmp_path):
    file = tmp_path / "grip.urdf"
    link = "<link name='{0}'><inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1'/></inertial></link>"
    joint = "<joint name='{0}' type='{1}'><parent link='{2}'/><child link='{3}'/><axis xyz='0 0 1'/>{4}</joint>"
    limit = "<limit lower='-1' upper='1' effort='5' velocity='{}'/>"
    file.write_text(
        "<robot name='grip'>" + "".join(link.format(name) for name in "abcd")
        + joint.format("j", "revolute", "a", "b", limit.format(-1))
        + joint.format("f", "fixed", "b", "c", "")
        + joint.format("m", "revolute", "b", "d", limit.format(1) + "<mimic joint='f' multiplier='2' offset='0.1'/>")
        + "</robot>"
    )  # fmt: skip
    found = read_robot(SourceSection(file=file))
    assert "m follows f, which is fixed, and so is locked at 0.1" in found.warnings
    assert any("velocity=-1 is taken for 1" in warning for warning in found.warnings)
