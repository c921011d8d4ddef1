"""Loops over a URDF: frames that are held together, where they close, and what determines the rest."""

import warnings

import numpy as np
import pytest
from robot_files import FOUR_BAR

from paramreduce_cli.config import load_config
from paramreduce_cli.errors import NumericalError
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.assembly import assemble
from paramreduce_cli.multibody.loops.coordinates import Coordinates

pin = pytest.importorskip("pinocchio")

LINK = """  <link name="{0}"><inertial><origin xyz="{1}"/><mass value="{2}"/><inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.03" iyz="0" izz="0.04"/></inertial></link>
"""
JOINT = """  <joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><origin xyz="{4}" rpy="{5}"/><axis xyz="{6}"/>{7}</joint>
"""
EFFORT = '<limit lower="-1" upper="1.2" effort="40" velocity="4"/>'
PASSIVE = '<limit lower="-3" upper="3" effort="0" velocity="9"/>'


def delta(seed):
    """Three arms, whose forearms turn about two axes of links without mass; the platform is on the first forearm.

    The other two forearms end in frames that are to meet frames of the platform. At zero they do not.
    """
    rng = np.random.default_rng(seed)
    base, platform, upper, fore = 0.3, 0.1, 0.4 + 0.1 * rng.random(), 0.8 + 0.2 * rng.random()
    text = '<robot name="delta">\n  <link name="ground"/>\n'
    for k in range(3):
        turn = 2 * np.pi / 3 * k
        at = f"{base * np.cos(turn)} {base * np.sin(turn)} 0"
        text += LINK.format(f"upper{k}", f"{upper / 2} 0 0.01", 1 + k)
        text += f'  <link name="cross{k}"/>\n' + LINK.format(f"fore{k}", f"0.4 {0.02 * k} 0", 0.5)
        text += JOINT.format(
            f"motor{k}", "revolute", "ground", f"upper{k}", at, f"0 0 {turn}", "0 1 0", EFFORT
        )
        text += JOINT.format(
            f"tilt{k}",
            "revolute",
            f"upper{k}",
            f"cross{k}",
            f"{upper} 0 0",
            "0 1.9 0",
            "0 1 0",
            PASSIVE,
        )
        text += JOINT.format(
            f"sway{k}", "continuous", f"cross{k}", f"fore{k}", "0 0 0", "0 0 0", "0 0 1", ""
        )
        text += f'  <link name="tip{k}"/>\n'
        text += JOINT.format(
            f"end{k}", "fixed", f"fore{k}", f"tip{k}", f"{fore} 0 0", "0 0 0", "1 0 0", ""
        )
    # The platform turns about two axes on the first tip, so that a plane of it may stay level.
    text += '  <link name="hinge"/>\n' + LINK.format("platform", "0 0 0", 0.8)
    text += JOINT.format("level", "continuous", "tip0", "hinge", "0 0 0", "0 -1.9 0", "0 1 0", "")
    text += JOINT.format("turn", "continuous", "hinge", "platform", "0 0 0", "0 0 0", "0 0 1", "")
    for k in (1, 2):
        turn = 2 * np.pi / 3 * k
        text += f'  <link name="corner{k}"/>\n'
        corner = platform * np.array([np.cos(turn) - 1, np.sin(turn), 0])
        text += JOINT.format(
            f"glue{k}",
            "fixed",
            "platform",
            f"corner{k}",
            " ".join(map(str, corner)),
            "0 0 0",
            "1 0 0",
            "",
        )
    return text + "</robot>\n"


def init(invoke, tmp_path, text, *options, code=0):
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    output = tmp_path / "config.yaml"
    output.unlink(missing_ok=True)
    said = invoke("init", path, *options, "--output", output, code=code)
    return (said.out + said.err), output, path


def closed_mechanism(output):
    config = load_config(output)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # the guess that was written is one
        return config, assemble(config.build_mechanism())


def check_against_pinocchio(path, config, mechanism, pairs):
    """Frames meet, velocities keep them together, and torques are those of the tree, projected."""
    model = pin.buildModelFromUrdf(str(path))
    data = model.createData()
    coordinates = Coordinates(mechanism, once=True)
    rng = np.random.default_rng(0)
    independent = list(mechanism.independent)
    home = mechanism.loops.assembly[independent]
    z, dz, ddz = (
        home + rng.uniform(-0.05, 0.05, (6, home.size)),
        *rng.uniform(-1, 1, (2, 6, home.size)),
    )
    states = coordinates.compute_states(z, dz, ddz)
    own = Dynamics(mechanism, once=True).compute_torques(*states, config.get_values())
    order = [model.joints[model.getJointId(name)] for name in mechanism.generalised_names]
    for q, dq, ddq, tau in zip(*states, own, strict=True):
        full, speed, acceleration = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
        for joint, x, v, a in zip(order, q, dq, ddq, strict=True):
            full[joint.idx_q : joint.idx_q + joint.nq] = (
                [np.cos(x), np.sin(x)] if joint.nq == 2 else [x]
            )
            speed[joint.idx_v], acceleration[joint.idx_v] = v, a
        pin.computeJointJacobians(model, data, full)
        pin.updateFramePlacements(model, data)
        rows = []
        for one, other in pairs:
            a, b = model.getFrameId(one), model.getFrameId(other)
            np.testing.assert_allclose(data.oMf[a].translation, data.oMf[b].translation, atol=1e-8)
            J = [pin.getFrameJacobian(model, data, f, pin.LOCAL_WORLD_ALIGNED)[:3] for f in (a, b)]
            rows.append(J[0] - J[1])
        phi = np.vstack(rows)
        np.testing.assert_allclose(phi @ speed, 0, atol=1e-7)
        driven = [order[k].idx_v for k in independent]
        others = [v for v in range(model.nv) if v not in driven]
        R = np.zeros((model.nv, len(driven)))
        R[driven] = np.eye(len(driven))
        R[others] = -np.linalg.lstsq(phi[:, others], phi[:, driven], rcond=None)[0]
        expected = R.T @ pin.rnea(model, data, full, speed, acceleration)
        np.testing.assert_allclose(tau, expected, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("seed", range(3))
def test_a_delta_robot_of_a_tree_and_two_pairs_of_frames(invoke, tmp_path, seed):
    pairs = [("tip1", "corner1"), ("tip2", "corner2")]
    close = [part for one, other in pairs for part in ("--close", f"{one}={other}:spherical")]
    said, output, path = init(invoke, tmp_path, delta(seed), *close)
    config, mechanism = closed_mechanism(output)
    # 11 coordinates less 6 equations: the three motors, and two that nothing determines.
    assert set(config.description.bodies.independent) >= {"motor0", "motor1", "motor2"}
    assert len(config.description.bodies.independent) == 5
    assert "the loops are closed at" in said
    assert "cross0 has no mass in the file, and is taken for massless" in " ".join(said.split())
    assert "TODO" not in output.read_text()
    check_against_pinocchio(path, config, mechanism, pairs)


@pytest.mark.parametrize("kind", ["revolute", "spherical"])
def test_a_four_bar_whose_ends_are_joined(invoke, tmp_path, kind):
    text = FOUR_BAR.replace("</robot>", "") + "".join(
        f'<link name="{name}"/>' + JOINT.format(f"to_{name}", "fixed", link, name, at, "1.5707963267948966 0 0", "1 0 0", "")
        for name, link, at in (("end", "coupler", "0.9 0 0"), ("top", "rocker", "0.7 0 0"))
    ) + "</robot>"  # fmt: skip
    text = text.replace('<link name="pin"/>', "").replace(
        '<joint name="q_pin" type="continuous"><parent link="coupler"/><child link="pin"/><origin xyz="0.9 0 0"/><axis xyz="0 1 0"/></joint>',
        "",
    )
    text = text.replace('izz="0.', 'ixy="0" ixz="0" iyz="0" izz="0.')
    _, output, path = init(
        invoke, tmp_path, text, "--close", f"end=top:{kind}", "--independent", "q_crank"
    )
    config = load_config(output)
    with pytest.warns(match="equations that close the loops 2 are independent"):
        mechanism = assemble(config.build_mechanism())
    assert config.description.bodies.independent == ["q_crank"]
    check_against_pinocchio(path, config, mechanism, [("end", "top")])


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--close", "tip1"], "--close tip1: write two links as A=B, or A=B:KIND"),
        (["--close", "tip1=corner1:ball"], "write two links as A=B, or A=B:KIND with fixed, revolute or spherical"),
        (["--close", "tip1=corner3"], "unknown link 'corner3'. Did you mean corner2?"),
        (["--close", "tip1=fore1"], "--close tip1=fore1: both links move with fore1, so there is nothing to close"),
        (["--close", "tip1=corner1:spherical", "--independent", "moter1"], "unknown joint 'moter1'. Did you mean motor1?"),
        (["--close", "tip1=corner1:spherical", "--independent", "end1"], "--independent end1: does not move"),
        (["--close", "tip1=corner1:spherical", *(part for k in (0, 1) for name in ("motor", "tilt", "sway")
           for part in ("--independent", f"{name}{k}"))], "--independent: the loops tie"),
        (["--independent", "motor1"], "--independent: needs closed loops"),
    ],
)  # fmt: skip
def test_what_cannot_be_closed_gets_one_message(invoke, tmp_path, options, says):
    said, output, _ = init(invoke, tmp_path, delta(0), *options, code=2)
    assert says in " ".join(said.split())
    assert not output.exists()


CLOSE = ("--close", "tip1=corner1:spherical", "--close", "tip2=corner2:spherical")


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--ignore", "fore1"], "--close tip1=corner1: tip1 is left out"),
        (["--lock", "motor0=0", "--lock", "motor1=0", "--lock", "motor2=0", "--lock", "level=0", "--lock", "turn=0"],
         "the loops leave nothing that moves"),
    ],
)  # fmt: skip
def test_loops_of_which_too_little_is_left(invoke, tmp_path, options, says):
    said, output, _ = init(invoke, tmp_path, delta(0), *CLOSE, *options, code=2)
    assert says in " ".join(said.split())
    assert not output.exists()


def test_a_base_that_floats_stays_where_it_is_while_loops_are_closed(invoke, tmp_path):
    _, fixed, _ = init(invoke, tmp_path, delta(0), *CLOSE)
    guess = load_config(fixed).description.bodies.guess
    _, floating, _ = init(invoke, tmp_path, delta(0), *CLOSE, "--floating")
    bodies = load_config(floating).description.bodies
    assert bodies.guess == pytest.approx(guess, abs=2e-6)
    assert len(bodies.independent) == 6 + 5
    assert all(f"q_ground_{k}" in bodies.independent for k in range(1, 7))


def test_what_is_named_comes_first_and_others_are_added(invoke, tmp_path):
    """Joints beside the loop, and those that are left over, are independent besides; a base that floats too."""
    close = ("--close", "tip1=corner1:spherical", "--independent", "tilt1")
    for options, base in (((), 0), (("--floating",), 6)):
        said, output, _ = init(invoke, tmp_path, delta(0), *close, *options)
        found = load_config(output).description.bodies.independent
        assert {"tilt1", "motor2", "tilt2", "sway2"} <= set(found)
        assert len(found) == base + 8 - 3 + 3
        assert "independent coordinates, which determine all others" in said
        closed_mechanism(output)


def test_driven_joints_that_the_loops_tie_are_said(invoke, tmp_path):
    """Welded rods of a five-bar leave its two motors nothing: their hinges turn about y, and a weld holds that turn."""
    text = '<robot name="five">\n  <link name="ground"/>\n'
    for side, x in (("l", -0.2), ("r", 0.2)):
        text += LINK.format(f"crank_{side}", "0 0 0.15", 1) + LINK.format(
            f"rod_{side}", "0 0 0.2", 0.5
        )
        text += JOINT.format(
            f"m_{side}", "revolute", "ground", f"crank_{side}", f"{x} 0 0", "0 0 0", "0 1 0", EFFORT
        )
        text += JOINT.format(
            f"e_{side}",
            "revolute",
            f"crank_{side}",
            f"rod_{side}",
            "0 0 0.3",
            "0 0 0",
            "0 1 0",
            PASSIVE,
        )
        text += f'  <link name="tip_{side}"/>\n'
        text += JOINT.format(
            f"t_{side}", "fixed", f"rod_{side}", f"tip_{side}", "0 0 0.4", "0 0 0", "1 0 0", ""
        )
    text += "</robot>\n"
    for kind, tied in (("fixed", True), ("spherical", False)):
        said, output, _ = init(invoke, tmp_path, text, "--close", f"tip_l=tip_r:{kind}")
        assert ("although the joints are driven" in said) == tied
        independent = load_config(output).description.bodies.independent
        assert (set(independent) == {"m_l", "m_r"}) != tied


def test_blanks_around_the_signs_of_a_pair_do_not_matter(invoke, tmp_path):
    _, output, _ = init(invoke, tmp_path, delta(0), *CLOSE)
    expected = load_config(output).description.bodies.closures
    spaced = [
        part.replace("=", " = ").replace(":", " : ") if "=" in part else part for part in CLOSE
    ]
    _, output, _ = init(invoke, tmp_path, delta(0), *spaced)
    assert load_config(output).description.bodies.closures == expected


def test_loops_that_do_not_close_are_left_to_be_guessed(invoke, tmp_path):
    far = delta(0).replace('"0.3 0.0 0"', '"5 0.0 0"')
    said, output, _ = init(
        invoke,
        tmp_path,
        far,
        "--close",
        "tip1=corner1:spherical",
        "--close",
        "tip2=corner2:spherical",
    )
    assert "TODO description.tree.guess: the loops cannot be closed from the guess" in " ".join(
        said.split()
    )
    refused = invoke("build-model", output, "--results", tmp_path / "r", code=2).err
    assert "description.tree.guess: the loops cannot be closed from the guess" in " ".join(
        refused.split()
    )


def test_a_guess_of_zeros_lets_the_driven_coordinates_move_and_says_so(invoke, tmp_path):
    """A four-bar whose crank points away from the rocker at zero, where coupler and rocker do not reach."""
    text = '<robot name="four">\n  <link name="ground"/>\n'
    for name, joint, parent, at, turn in (
        ("crank", "q1", "ground", "0 0 0", "0 0 3.141592653589793"),
        ("coupler", "q2", "crank", "0.2 0 0", "0 0 3.141592653589793"),
        ("rocker", "q3", "ground", "0.6 0 0", "0 0 1.5707963267948966"),
    ):
        text += LINK.format(name, "0.1 0 0", 1)
        text += JOINT.format(joint, "revolute", parent, name, at, turn, "0 0 1", EFFORT)
    for name, length in (("coupler", 0.3), ("rocker", 0.25)):
        text += f'  <link name="{name}_tip"/>\n'
        text += JOINT.format(
            f"{name}_end", "fixed", name, f"{name}_tip", f"{length} 0 0", "0 0 0", "1 0 0", ""
        )
    text += "</robot>\n"
    _, output, _ = init(
        invoke, tmp_path, text, "--close", "coupler_tip=rocker_tip:spherical", "--independent", "q1"
    )
    assert abs(load_config(output).description.bodies.guess["q1"]) > 0.1
    lines = [line for line in output.read_text().splitlines() if "guess:" not in line]
    output.write_text("\n".join(lines))
    with pytest.warns(
        match=r"do not close with zero for q1; they are closed with all coordinates free to move, at guess: \{"
    ):
        found = assemble(load_config(output).build_mechanism())
    assert abs(found.loops.assembly[found.independent[0]]) > 0.1
    output.write_text(
        "\n".join(lines).replace(
            "    independent: [q1]", "    independent: [q1]\n    guess: {q1: 0.01}"
        )
    )
    with pytest.raises(NumericalError, match=r"cannot be closed from the guess with q1 = 0\.01"):
        assemble(load_config(output).build_mechanism())


def test_lists_for_all_coordinates_are_cut_to_the_independent_ones(tmp_path, invoke):
    from conftest import CONFIGS

    text = (CONFIGS / "four_bar.yaml").read_text()
    bodies = load_config(CONFIGS / "four_bar.yaml").description.bodies
    place = bodies.list_coordinates().index(bodies.independent[0])
    values = [1.5, 2.5, 3.5]
    path = tmp_path / "config.yaml"
    path.write_text(text)
    settings = ["nominal_torque=[1.5, 2.5, 3.5]", "trajectories.velocity_limits=[1.5, 2.5, 3.5]",
                "trajectories.position_limits=[[-1, 1], [-2, 2], [-3, 3]]"]  # fmt: skip
    with pytest.warns(match="given for all 3 coordinates; those of the independent ones are taken"):
        config = load_config(path, settings)
    assert config.nominal_torque == [values[place]]
    assert config.trajectories.velocity_limits == [values[place]]
    assert config.trajectories.position_limits == [[-(place + 1), place + 1]]
    assert (
        "has 2 values"
        in invoke(
            "build-model",
            path,
            "--results",
            tmp_path / "r",
            settings=["nominal_torque=[1, 2]"],
            code=2,
        ).err
    )


@pytest.mark.parametrize(("upper", "kept"), [(3, True), (0.25, False)])
def test_limits_of_dependent_joints_become_constraints_unless_the_guess_is_outside(
    invoke, tmp_path, upper, kept
):
    text = delta(0).replace('upper="3"', f'upper="{upper}"')
    said, output, _ = init(invoke, tmp_path, text, *CLOSE)
    constraints = {c.name: (c.min, c.max) for c in load_config(output).trajectories.constraints}
    assert constraints["tilt1"] == (-3, upper)
    assert ("tilt0" in constraints) == kept
    assert ("the guess lies outside the limits" in " ".join(said.split())) != kept
