import json

import h5py
import numpy as np
import pytest
from conftest import CONFIGS

TWO_LINK = CONFIGS / "two_link.yaml"


@pytest.fixture
def brought(tmp_path):
    """An observation matrix of the user's own, with nothing about a robot."""
    rng = np.random.default_rng(0)
    W = rng.normal(size=(300, 7))
    W[:, 6] = W[:, 0] - W[:, 1]
    phi = np.array([5.0, 0.1, 3.0, 0, 0, 1.0, 0])
    path = tmp_path / "mine.h5"
    with h5py.File(path, "w") as file:
        file["estimation/W"] = W
        file["estimation/tau"] = (W @ phi).reshape(-1, 2)
    return path


def test_reduce_an_observation_matrix_without_any_config(invoke, brought, tmp_path):
    code, out, _ = invoke("reduce", "--samples", brought, "--results", tmp_path / "r")
    assert code == 0
    with h5py.File(tmp_path / "r" / "reduction.h5") as file:
        order = file["forward-selection/order"][:]
        errors = file["forward-selection/torque_error"][:]
        assert set(order[:3]) <= {0, 2, 5, 6, 1}
        assert errors[3] < 1e-12
        assert file["rank"][()] == 6
        assert file["qr/minimum_norm"][:].tolist() == [False] * 6 + [True]
    code, out, _ = invoke("inspect", tmp_path / "r" / "reduction.h5", "--model", "qr:6")
    assert code == 0
    assert "p1" in out


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda f: f.__delitem__("estimation/tau"), "/estimation/tau is missing"),
        (lambda f: f.__delitem__("estimation/W"), "/estimation/W is missing"),
        (lambda f: f["estimation/W"].__setitem__((7, 3), np.nan), "not finite"),
        (lambda f: f.__setitem__("nominal_torque", [1.0, 2.0, 3.0]), "nominal_torque must hold 2"),
        (lambda f: f.__setitem__("nominal_torque", [1.0, 0.0]), "no torque to weigh"),
        (lambda f: f.__setitem__("parameters/names", ["a", "b"]), "7 different names"),
        (lambda f: f["estimation/tau"].__setitem__((...,), 0.0), "no torque to weigh"),
    ],
)
def test_observation_matrices_that_do_not_fit(invoke, brought, tmp_path, change, says):
    with h5py.File(brought, "a") as file:
        change(file)
    code, _, err = invoke("reduce", "--samples", brought, "--results", tmp_path / "r")
    assert code == 2
    assert says in err
    assert not (tmp_path / "r" / "reduction.h5").exists()


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("estimation/trajectory", np.zeros(7), "150 finite numbers"),
        ("estimation/trajectory", np.full(150, -1.0), "0, 1, 2"),
        ("estimation/time", np.full(150, np.nan), "150 finite numbers"),
        ("estimation/z", np.zeros((3, 2)), "(150, 2)"),
        ("parameters/names", np.arange(7), "must hold text"),
    ],
)
def test_extras_of_an_observation_matrix_are_checked(invoke, brought, tmp_path, name, value, says):
    with h5py.File(brought, "a") as file:
        file[name] = value
    code, _, err = invoke("reduce", "--samples", brought, "--results", tmp_path / "r")
    assert code == 2
    assert says in err


@pytest.mark.parametrize(
    ("W", "says"),
    [
        (np.zeros((300, 7)), "no column"),
        (np.zeros((0, 7)), "empty"),
        (np.full((300, 7), 1e308), "too large"),
        (np.ones((300, 7)) * 1j, "real numbers"),
        (np.random.default_rng(0).normal(size=(4, 30)), "4 rows are too few for 30 parameters"),
    ],
)
def test_observation_matrices_with_nothing_to_choose_from(invoke, tmp_path, W, says):
    with h5py.File(tmp_path / "mine.h5", "w") as file:
        file["estimation/W"] = W
        file["estimation/tau"] = np.random.default_rng(1).normal(size=(len(W) // 2, 2))
    code, _, err = invoke("reduce", "--samples", tmp_path / "mine.h5", "--results", tmp_path / "r")
    assert code == 2
    assert says in err


def test_triangular_factors_of_others_are_not_trusted(invoke, brought, tmp_path):
    with h5py.File(brought, "a") as file:
        file["estimation/factors"] = np.zeros((1, 2, 8, 8))
    code, _, _ = invoke("reduce", "--samples", brought, "--results", tmp_path / "r")
    assert code == 0
    with h5py.File(tmp_path / "r" / "reduction.h5") as file:
        assert file["rank"][()] == 6


def test_samples_of_another_robot_with_a_config(invoke, brought, two_link_copy):
    code, _, err = invoke("reduce", TWO_LINK, "--samples", brought, "--results", two_link_copy)
    assert code == 2
    assert "another robot" in err


def test_brought_coefficients_repeat_everything_after_the_optimiser(
    invoke, two_link_results, tmp_path
):
    summary = two_link_results / "report" / "summary.json"
    code, _, _ = invoke(
        "run", TWO_LINK, "--results", tmp_path, "--quiet", "--set", f"trajectories.file={summary}"
    )
    assert code == 0
    code, out, _ = invoke("compare", summary, tmp_path)
    assert code == 0, out


def test_brought_coefficients_of_another_robot(invoke, two_link_results, tmp_path):
    summary = two_link_results / "report" / "summary.json"
    code, _, err = invoke(
        "run",
        CONFIGS / "puma560.yaml",
        "--results",
        tmp_path,
        "--set",
        f"trajectories.file={summary}",
    )
    assert code == 2
    assert "2 joints, but puma560 has 6" in err


def test_brought_states_and_torques(invoke, two_link_results, tmp_path, write_config):
    with h5py.File(two_link_results / "samples.h5") as file:
        for which in ("estimation", "validation"):
            columns = [file[f"{which}/{key}"][:] for key in ("z", "dz", "ddz", "tau")]
            header = ",".join(
                ["t", *(f"{k}{j}" for k in ("z", "dz", "ddz", "tau") for j in (1, 2))]
            )
            table = np.column_stack([file[f"{which}/time"][:], *columns])
            np.savetxt(tmp_path / f"{which}.csv", table, delimiter=",", header=header, comments="")
    sampling = "sampling:\n  estimation_file: estimation.csv\n  validation_file: validation.csv\n\nselected:"
    path = write_config(("selected:", sampling))
    code, out, _ = invoke("run", path, "--results", tmp_path / "r")
    assert code == 0
    assert "optimize-trajectories" not in out
    found, expected = (
        json.loads((folder / "report" / "summary.json").read_text())["selected"]["torque_error"]
        for folder in (tmp_path / "r", two_link_results)
    )
    assert found["estimation"] == pytest.approx(expected["estimation"], rel=1e-6)
    assert found["validation"] == pytest.approx(expected["validation"], rel=1e-6)
