"""What a user of closed loops can get wrong, and what they are told."""

import h5py
import numpy as np
import pytest
from conftest import CONFIGS

FOUR_BAR = CONFIGS / "four_bar.yaml"


def build(invoke, tmp_path, *overrides, text=None, stage="build-model"):
    path = FOUR_BAR
    if text is not None:
        path = tmp_path / "mine.yaml"
        path.write_text(text)
    options = [part for override in overrides for part in ("--set", override)]
    return path, invoke(stage, path, "--results", tmp_path / "r", "--quiet", *options)


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ("q_crank: pi/2, q", "q_crank: 0, q_cranc: 1, q", 23, "did you mean q_crank?"),
        ("coupler: 0.9 ", "coupler: 0.1 ", 23, "at best by 0.277, at pin (x)"),
        ("bodies: [coupler, rocker]", "bodies: [coupler, roker]", 21, "did you mean rocker?"),
        ("bodies: [coupler, rocker]", "bodies: [rocker, rocker]", 21, "ties 'rocker' to itself"),
        ("type: planar", "type: point", 19, "pin (z)"),
        ("type: planar", "type: revolute", 19, "pin (z), pin (tilt x), pin (tilt y)"),
        ("type: planar", "type: distance", 21, "length belongs to a closure of type distance"),
        ("type: planar", "type: pin", 21, "planar"),
        ("[q_crank]\n", "[q_crank, q_rocker]\n", 22, "but 1 are independent"),
        ("[q_crank]\n", "[]\n", 13, "closures and independent belong together"),
        ("[q_crank]\n", "[q_crank, q_coupler, q_rocker]\n", 22, "all coordinates are named"),
        ("[q_crank]\n", "[q_cronk]\n", 22, "did you mean q_crank?"),
        ("parent: crank, at", "parent: crank, axes: [x, y], at", 17, "takes 1 axes, not 2"),
        ("parent: crank, at", "parent: crank, axes: [0, 0, 0], at", 17, "a direction"),
        ("parent: crank, at", "parent: crank, joint: spherical, at", 17, "3 coordinates, not 1"),
        ("parent: crank, at", "parent: crunk, at", 17, "did you mean crank?"),
        ("at: [ground, 0, 0]", "at: [grund, 0, 0]", 18, "with the constants ground, crank"),
        ("at: [ground, 0, 0]", "at: [{rx: 0, ry: 1}]", 18, "one of xyz, rx, ry, rz"),
        ("q_rocker}\n", "q_crank}\n", 18, "belongs to several joints"),
    ],
)  # fmt: skip
def test_mistakes_are_placed_and_explained(invoke, tmp_path, old, new, line, says):
    text = FOUR_BAR.read_text()
    assert old in text
    path, (code, out, err) = build(invoke, tmp_path, text=text.replace(old, new, 1))
    assert (code, out) == (2, "")
    assert f"{path}, line {line}: " in err
    assert says in err
    assert "Traceback" not in err


def test_an_override_is_named_instead_of_the_line(invoke, tmp_path):
    _, (code, _, err) = build(invoke, tmp_path, "description.tree.independent=[q_crank, q_rocker]")
    assert code == 2
    assert err.startswith("Error: --set description.tree.independent=[q_crank, q_rocker]: ")


def test_a_loop_without_freedom(invoke, tmp_path):
    text = FOUR_BAR.read_text().replace(
        "    independent:",
        "      - {name: strut, type: planar, bodies: [base, crank], at: [[0, crank, 0], [crank, 0, 0]]}\n"
        "    independent:",
    )
    _, (code, _, err) = build(invoke, tmp_path, text=text)
    assert code == 2
    assert "over-constrained" in err


def test_coordinates_that_are_tied_to_each_other(invoke, tmp_path):
    """Of two four-bars side by side, crank and rocker of the first are no choice."""
    text = FOUR_BAR.read_text()
    bodies, _, rest = text.partition("    closures:\n")
    more = [
        "      - {name: crank2, at: [0, 0, 1], coordinates: q_crank2}\n",
        "      - {name: coupler2, parent: crank2, at: [crank, 0, 0], coordinates: q_coupler2}\n",
        "      - {name: rocker2, at: [ground, 0, 1], coordinates: q_rocker2}\n",
    ]
    text = bodies + "".join(more) + "    closures:\n" + rest
    text = text.replace(
        "    independent: [q_crank]\n",
        "      - {type: planar, bodies: [coupler2, rocker2], at: [[coupler, 0, 0], [rocker, 0, 0]]}\n"
        "    independent: [q_crank, q_rocker]\n",
    ).replace("q_rocker: 2}", "q_rocker: 2, q_crank2: pi/2, q_coupler2: -pi/3, q_rocker2: 2}")
    text = text.replace(
        "slender_rods:\n", "slender_rods:\n    crank2: {}\n    coupler2: {}\n    rocker2: {}\n"
    )
    path, (code, _, err) = build(invoke, tmp_path, text=text)
    assert code == 2
    assert "are not independent: the loops tie them to each other" in err
    assert "Choose others, for example" in err
    assert f"{path}, line " in err


def test_bounds_that_cannot_be_kept_name_the_one_in_the_way(invoke, tmp_path):
    folder = tmp_path / "r"
    _, (code, _, _) = build(invoke, tmp_path)
    assert code == 0
    before = (folder / "model.h5").read_bytes()
    bound = "{name: high, quantity: coordinate, coordinate: q_rocker, min: 3.1}"
    _, (code, _, err) = build(
        invoke, tmp_path, f"trajectories.constraints=[{bound}]", stage="optimize-trajectories"
    )
    assert code == 2
    assert "high (coordinate, at least 3.1)" in err
    assert (folder / "model.h5").read_bytes() == before
    assert not (folder / "trajectories.h5").exists()


def test_limits_that_the_loops_do_not_reach(invoke, tmp_path):
    """Driven by the rocker, the linkage cannot make a whole turn."""
    driven = "description.tree.independent=[q_rocker]"
    _, (code, _, _) = build(invoke, tmp_path, driven)
    assert code == 0
    _, (code, _, err) = build(invoke, tmp_path, driven, stage="optimize-trajectories")
    assert code == 2
    assert "trajectories.position_limits" in err
    assert "use_full_range" in err


@pytest.mark.parametrize(
    ("constraint", "says"),
    [
        ("{name: a, quantity: coordinate, min: 0}", "coordinate needs coordinate"),
        ("{name: a, quantity: coordinate, coordinate: q_x, min: 0}", "coordinate 'q_x' is not"),
        ("{name: a, quantity: angle, bodies: [crank, roker], max: 1}", "did you mean rocker?"),
        ("{name: a, quantity: angle, bodies: [crank, rocker]}", "give min or max"),
        ("{name: a, quantity: angle, bodies: [crank, rocker], max: 4}", "between 0 and pi"),
        ("{name: a, quantity: distance, bodies: [crank, rocker], max: -1}", "above zero"),
        ("{name: a, quantity: singularity, max: 1}", "takes a min"),
        ("{name: a, quantity: singularity, min: 0.1, body: crank}", "takes no body"),
        ("{name: a, quantity: coordinate, coordinate: q_crank, min: 2, max: 1}", "bounds cross"),
    ],
)
def test_constraints_that_do_not_make_sense(invoke, tmp_path, constraint, says):
    _, (code, _, err) = build(invoke, tmp_path, f"trajectories.constraints=[{constraint}]")
    assert code == 2
    assert says in err


def test_recordings_beyond_the_reach_of_the_loops(invoke, tmp_path):
    table = tmp_path / "rocker.csv"
    rows = "".join(f"{k / 10},{1.9 + k / 10},1,{k % 3}\n" for k in range(40))
    table.write_text("time,z1,dz1,ddz1\n" + rows)
    overrides = [
        "description.tree.independent=[q_rocker]",
        f"sampling.estimation_file={table}",
        f"sampling.validation_file={table}",
    ]
    assert build(invoke, tmp_path, *overrides)[1][0] == 0
    _, (code, _, err) = build(invoke, tmp_path, *overrides, stage="sample")
    assert code == 2
    assert "the loops cannot be closed at q_rocker = " in err
    assert not (tmp_path / "r" / "samples.h5").exists()


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("crank: 0.4 ", "crank: 2*rocker ", "constants.crank: '2*rocker' is not a number"),
        ("crank: 0.4 ", "crank: crank + 0.1 ", "constants.crank: 'crank + 0.1' is not a number"),
        ("crank: 0.4 ", "pi: 3\n  crank: 0.4 ", "constants.pi: cannot be the name of a constant"),
        ("crank: 0.4 ", "2nd: 3\n  crank: 0.4 ", "constants.2nd: cannot be the name of a constant"),
    ],
)
def test_constants_use_those_above_them_only(invoke, tmp_path, old, new, says):
    _, (code, _, err) = build(invoke, tmp_path, text=FOUR_BAR.read_text().replace(old, new, 1))
    assert code == 2
    assert says in err
    assert err.count("Error:") == 1


def test_hinges_closed_the_wrong_way_round(invoke, tmp_path):
    text = FOUR_BAR.read_text().replace(
        "type: planar, bodies: [coupler, rocker], at: [[coupler, 0, 0], [rocker, 0, 0]]",
        "type: revolute, bodies: [wrist, rocker], at: [[0, 0, 0], [{xyz: [rocker, 0, 0]}, {rx: pi}]]",
    )
    text = text.replace(
        "    closures:",
        "      - {name: slide, parent: coupler, joint: prismatic, at: [coupler, 0, 0], massless: true}\n"
        "      - {name: wrist, parent: slide, joint: universal, massless: true}\n    closures:",
    )
    _, (code, _, err) = build(invoke, tmp_path, text=text)
    assert code == 2
    assert "closes with its two z axes against each other" in err


def test_images_that_leave_the_limits_are_no_symmetry(invoke, tmp_path):
    overrides = ["trajectories.count=1", "trajectories.starts=1", "trajectories.max_iterations=5"]
    options = [part for o in overrides for part in ("--set", o)]
    config = CONFIGS / "five_bar.yaml"
    code, _, _ = invoke("build-model", config, "--results", tmp_path, "--quiet")
    assert code == 0
    code, _, _ = invoke("optimize-trajectories", config, "--results", tmp_path, "--quiet", *options)
    assert code == 0
    wrong = "sampling.symmetries=[[-q_right, -q_left]]"
    code, _, err = invoke(
        "sample", config, "--results", tmp_path, "--quiet", *options, "--set", wrong
    )
    assert code == 2
    assert err.startswith(f"Error: --set {wrong}: sampling.symmetries: the image")
    assert not (tmp_path / "samples.h5").exists()


def test_a_mechanism_without_mass(invoke, tmp_path):
    text = FOUR_BAR.read_text()
    for name in ("crank", "coupler", "rocker"):
        text = text.replace(f"{{name: {name},", f"{{massless: true, name: {name},")
    text = text[: text.index("    crank: {m:")] + text[text.index("nominal_torque") :]
    text = text.replace("slender_rods:\n", "slender_rods: {}\n")
    _, (code, _, err) = build(invoke, tmp_path, text=text)
    assert code == 2
    assert "are all massless" in err


def test_groups_and_the_sizes_they_leave(invoke, tmp_path):
    groups = (
        "reduction.groups=[{name: a, parameters: [m_coupler, Izz_crank, mx_crank]}, "
        "{name: b, parameters: [my_crank, Izz_coupler, mx_coupler]}, "
        "{name: c, parameters: [my_coupler, Izz_rocker, mx_rocker, my_rocker]}]"
    )
    overrides = [groups, "trajectories.count=1", "trajectories.starts=1", "selected.n=2",
                 "selected.torque_error=null", "report.formats=[svg]"]  # fmt: skip
    _, (code, _, err) = build(invoke, tmp_path, *overrides, stage="run")
    assert code == 2
    assert "selected.n is 2, but with groups forward-selection has subsets of" in err
    before = (tmp_path / "r" / "reduction.h5").read_bytes()
    stop = "reduction.stop.parameters=1"
    _, (code, _, err) = build(invoke, tmp_path, *overrides[:3], stop, stage="reduce")
    assert code == 2
    assert "the smallest subset has" in err
    assert (tmp_path / "r" / "reduction.h5").read_bytes() == before
    overrides[3] = "selected.n=10"
    _, (code, _, err) = build(invoke, tmp_path, *overrides, stage="run")
    assert (code, err) == (0, "")


def test_a_tied_group_has_the_value_that_fits_all_its_members(invoke, tmp_path):
    overrides = [
        "reduction.groups=[{name: rods, bodies: [coupler, rocker], kinds: [Izz], tied: true}]",
        "trajectories.count=1",
        "trajectories.starts=1",
        "report.formats=[svg]",
        "selected.n=9",
        "selected.torque_error=null",
        "validation.accept.torque_error_validation=10",
    ]
    _, (code, _, err) = build(invoke, tmp_path, *overrides, stage="run")
    assert (code, err) == (0, "")
    with (
        h5py.File(tmp_path / "r" / "reduction.h5") as file,
        h5py.File(tmp_path / "r" / "samples.h5") as samples,
    ):
        names = [name.decode() for name in file["parameters/names"]]
        standard = [name.decode() for name in samples["parameters/names"]]
        assert "Izz_rods" in names
        assert "Izz_coupler" not in names
        W, tau = samples["estimation/W"][:], samples["estimation/tau"][:].ravel()
        kept = file["forward-selection/order"][:3].tolist()
        columns = []
        for k in kept:
            members = ["Izz_coupler", "Izz_rocker"] if names[k] == "Izz_rods" else [names[k]]
            columns.append(sum(W[:, standard.index(member)] for member in members))
        values, *_ = np.linalg.lstsq(np.column_stack(columns), tau, rcond=None)
        error = np.linalg.norm(tau - np.column_stack(columns) @ values) / np.linalg.norm(tau)
        assert file["forward-selection/parameters/3"][:] == pytest.approx(values, rel=1e-6)
        assert file["forward-selection/torque_error"][2] == pytest.approx(error, rel=1e-6)
