"""What a user of closed loops can get wrong, and what they are told."""

import h5py
import numpy as np
import pytest
from conftest import CONFIGS

FOUR_BAR = CONFIGS / "four_bar.yaml"


@pytest.fixture
def run(invoke, tmp_path):
    """Run a stage, which fails unless another exit code is given; returns the standard error."""

    def call(*settings, stage="build-model", path=FOUR_BAR, code=2):
        command = (stage, path, "--results", tmp_path / "r", "--quiet")
        out, err = invoke(*command, settings=settings, code=code)
        assert out == ""
        return err

    return call


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ("q_crank: pi/2, q", "q_crank: 0, q_cranc: 1, q", 23, "Did you mean q_crank?"),
        ("coupler: 0.9 ", "coupler: 0.1 ", 23, "at best by 0.277, at pin (x)"),
        ("bodies: [coupler, rocker]", "bodies: [coupler, roker]", 21, "Did you mean rocker?"),
        ("bodies: [coupler, rocker]", "bodies: [rocker, rocker]", 21, "ties 'rocker' to itself"),
        ("type: planar", "type: distance", 21, "length belongs to a closure of type distance"),
        ("type: planar", "type: pin", 21, "planar"),
        ("[q_crank]\n", "[q_crank, q_rocker]\n", 22, "but 1 are independent"),
        ("[q_crank]\n", "[]\n", 13, "has closures, but no independent"),
        ("[q_crank]\n", "[q_crank, q_coupler, q_rocker]\n", 22, "all coordinates are named"),
        ("[q_crank]\n", "[q_cronk]\n", 22, "Did you mean q_crank?"),
        ("parent: crank, at", "parent: crank, axes: [x, y], at", 17, "takes 1 axes, not 2"),
        ("parent: crank, at", "parent: crank, axes: [0, 0, 0], at", 17, "a direction"),
        ("parent: crank, at", "parent: crank, joint: spherical, at", 17, "3 coordinates, not 1"),
        ("parent: crank, at", "parent: crunk, at", 17, "Did you mean crank?"),
        ("at: [ground, 0, 0]", "at: [grund, 0, 0]", 18, "with the constants ground, crank"),
        ("at: [ground, 0, 0]", "at: [{rx: 0, ry: 1}]", 18, "one of xyz, rx, ry, rz"),
        ("q_rocker}\n", "q_crank}\n", 18, "belongs to several joints"),
        ("crank: 0.4 ", "crank: 2*rocker ", 7, "constants.crank: '2*rocker' is not a number"),
        ("crank: 0.4 ", "crank: crank + 0.1 ", 7, "constants.crank: 'crank + 0.1' is not a number"),
        ("crank: 0.4 ", "pi: 3\n  crank: 0.4 ", 7, "constants.pi: cannot be the name of a constant"),
        ("crank: 0.4 ", "2nd: 3\n  crank: 0.4 ", 7, "constants.2nd: cannot be the name of a constant"),
    ],
)  # fmt: skip
def test_mistakes_are_placed_and_explained(run, write_config, old, new, line, says):
    path = write_config((old, new), robot="four_bar")
    err = run(path=path)
    assert f"{path}, line {line}: " in err
    assert says in err
    assert "Traceback" not in err
    assert err.count("Error:") == (3 if new == "q_crank}\n" else 1)  # q_rocker is used twice more


def test_an_override_is_named_instead_of_the_line(run):
    err = run("description.tree.independent=[q_crank, q_rocker]")
    assert err.startswith("Error: --set description.tree.independent=[q_crank, q_rocker]: ")


STRUT = "      - {name: strut, type: planar, bodies: [base, crank], at: [[0, crank, 0], [crank, 0, 0]]}\n"


@pytest.mark.parametrize(
    ("replacements", "says"),
    [
        ([("    independent:", f"{STRUT}    independent:")], "over-constrained"),
        ([("type: planar, bodies: [coupler, rocker], at: [[coupler, 0, 0], [rocker, 0, 0]]",
           "type: revolute, bodies: [wrist, rocker], at: [[0, 0, 0], [{xyz: [rocker, 0, 0]}, {rx: pi}]]"),
          ("    closures:",
           "      - {name: slide, parent: coupler, joint: prismatic, at: [coupler, 0, 0], massless: true}\n"
           "      - {name: wrist, parent: slide, joint: universal, massless: true}\n    closures:")],
         "closes with its two z axes against each other"),
    ],
)  # fmt: skip
def test_loops_that_cannot_work(run, write_config, replacements, says):
    assert says in run(path=write_config(*replacements, robot="four_bar"))


def test_coordinates_that_are_tied_to_each_other(run, write_config):
    """Of two four-bars side by side, crank and rocker of the first are no choice."""
    path = write_config(
        ("    closures:\n",
         "      - {name: crank2, at: [0, 0, 1], coordinates: q_crank2}\n"
         "      - {name: coupler2, parent: crank2, at: [crank, 0, 0], coordinates: q_coupler2}\n"
         "      - {name: rocker2, at: [ground, 0, 1], coordinates: q_rocker2}\n    closures:\n"),
        ("    independent: [q_crank]\n",
         "      - {type: planar, bodies: [coupler2, rocker2], at: [[coupler, 0, 0], [rocker, 0, 0]]}\n"
         "    independent: [q_crank, q_rocker]\n"),
        ("q_rocker: 2}", "q_rocker: 2, q_crank2: pi/2, q_coupler2: -pi/3, q_rocker2: 2}"),
        ("slender_rods:\n", "slender_rods:\n    crank2: {}\n    coupler2: {}\n    rocker2: {}\n"),
        robot="four_bar",
    )  # fmt: skip
    err = run(path=path)
    assert "are not independent: the loops tie them to each other" in err
    assert "Choose others, for example" in err
    assert f"{path}, line " in err


def test_bounds_that_cannot_be_kept_name_the_one_in_the_way(run, tmp_path):
    run(code=0)
    before = (tmp_path / "r" / "model.h5").read_bytes()
    bound = "{name: high, quantity: coordinate, coordinate: q_rocker, min: 3.1}"
    err = run(f"trajectories.constraints=[{bound}]", stage="optimize-trajectories")
    assert "high (coordinate, at least 3.1)" in err
    assert (tmp_path / "r" / "model.h5").read_bytes() == before
    assert not (tmp_path / "r" / "trajectories.h5").exists()


def test_limits_that_the_loops_do_not_reach(run):
    """Driven by the rocker, the linkage cannot make a whole turn."""
    driven = "description.tree.independent=[q_rocker]"
    run(driven, code=0)
    err = run(driven, stage="optimize-trajectories")
    assert "trajectories.position_limits" in err
    assert "use_full_range" in err


@pytest.mark.parametrize(
    ("constraint", "says"),
    [
        ("{name: a, quantity: coordinate, min: 0}", "coordinate needs coordinate"),
        ("{name: a, quantity: coordinate, coordinate: q_x, min: 0}", "unknown coordinate 'q_x'"),
        ("{name: a, quantity: angle, bodies: [crank, roker], max: 1}", "Did you mean rocker?"),
        ("{name: a, quantity: angle, bodies: [crank, rocker]}", "give min or max"),
        ("{name: a, quantity: angle, bodies: [crank, rocker], max: 4}", "between 0 and pi"),
        ("{name: a, quantity: distance, bodies: [crank, rocker], max: -1}", "above zero"),
        ("{name: a, quantity: singularity, max: 1}", "takes a min"),
        ("{name: a, quantity: singularity, min: 0.1, body: crank}", "takes no body"),
        ("{name: a, quantity: coordinate, coordinate: q_crank, min: 2, max: 1}", "bounds cross"),
    ],
)
def test_constraints_that_do_not_make_sense(run, constraint, says):
    assert says in run(f"trajectories.constraints=[{constraint}]")


def test_recordings_beyond_the_reach_of_the_loops(run, tmp_path):
    table = tmp_path / "rocker.csv"
    rows = "".join(f"{k / 10},{1.9 + k / 10},1,{k % 3}\n" for k in range(40))
    table.write_text("time,z1,dz1,ddz1\n" + rows)
    settings = [
        "description.tree.independent=[q_rocker]",
        "sampling.torques=model",
        f"sampling.estimation_file={table}",
        f"sampling.validation_file={table}",
        "validation.accept={}",
    ]
    run(*settings, code=0)
    assert "the loops cannot be closed at q_rocker = " in run(*settings, stage="sample")
    assert not (tmp_path / "r" / "samples.h5").exists()


def test_images_that_leave_the_limits_are_no_symmetry(run, tmp_path):
    small = [
        "trajectories.count=1",
        "trajectories.test_count=1",
        "trajectories.starts=1",
        "trajectories.max_iterations=5",
    ]
    five_bar = CONFIGS / "five_bar.yaml"
    run(path=five_bar, code=0)
    run(*small, stage="optimize-trajectories", path=five_bar, code=0)
    wrong = "sampling.symmetries=[[-q_right, -q_left]]"
    err = run(*small, wrong, stage="sample", path=five_bar)
    assert err.startswith(f"Error: --set {wrong}: sampling.symmetries: the image")
    assert not (tmp_path / "r" / "samples.h5").exists()


def test_a_mechanism_without_mass(run):
    massless = [f"description.tree.bodies.{k}.massless=true" for k in range(3)]
    assert "are all massless" in run(*massless, "parameter_sets={slender_rods: {}}")


def test_groups_and_the_sizes_they_leave(run, tmp_path):
    groups = (
        "reduction.groups=[{name: a, parameters: [m_coupler, Izz_crank, mx_crank]}, "
        "{name: b, parameters: [my_crank, Izz_coupler, mx_coupler]}, "
        "{name: c, parameters: [my_coupler, Izz_rocker, mx_rocker, my_rocker]}]"
    )
    settings = [groups, "trajectories.count=1", "trajectories.test_count=1", "trajectories.starts=1",
                "selected.torque_error=null", "report.formats=[svg]"]  # fmt: skip
    err = run(*settings, "selected.n=2", stage="run")
    assert "selected.n is 2, but with groups forward-selection has subsets of" in err
    before = (tmp_path / "r" / "reduction.h5").read_bytes()
    err = run(*settings[:3], "reduction.stop.parameters=1", stage="reduce")
    assert "the smallest subset has" in err
    assert (tmp_path / "r" / "reduction.h5").read_bytes() == before
    assert run(*settings, "selected.n=10", stage="run", code=0) == ""


def test_a_tied_group_has_the_value_that_fits_all_its_members(run, tmp_path):
    settings = [
        "reduction.groups=[{name: rods, bodies: [coupler, rocker], kinds: [Izz], tied: true}]",
        "trajectories.count=1", "trajectories.test_count=1", "trajectories.starts=1", "report.formats=[svg]", "selected.n=9",
        "selected.torque_error=null", "validation.accept.torque_error_validation=10",
    ]  # fmt: skip
    assert run(*settings, stage="run", code=0) == ""
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
