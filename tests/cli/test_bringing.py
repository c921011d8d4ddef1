import json

import h5py
import numpy as np
import pytest
from conftest import CONFIGS, ONE_FORMAT, TWO_LINK, summary_of


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
    invoke("reduce", "--samples", brought, "--results", tmp_path / "r")
    with h5py.File(tmp_path / "r" / "reduction.h5") as file:
        order = file["forward-selection/order"][:]
        errors = file["forward-selection/torque_error"][:]
        assert set(order[:3]) <= {0, 2, 5, 6, 1}
        assert errors[3] < 1e-12
        assert file["rank"][()] == 6
        assert file["qr/minimum_norm"][:].tolist() == [False] * 6 + [True]
    assert "p1" in invoke("inspect", tmp_path / "r" / "reduction.h5", "--model", "qr:6").out


W, TAU = "estimation/W", "estimation/tau"


SETTINGS = """
reduction:
  heuristics: [forward-selection, qr]
selected:
  cross_validation: true
validation:
  stability: false
  accept: {torque_error_validation: 0.2}
"""


@pytest.fixture
def noisy(tmp_path):
    """Observation matrices of three trajectories, and one to validate on; torques with noise."""
    rng = np.random.default_rng(1)
    phi = np.array([5.0, 4.0, 3.0, 0, 0, 0, 0])
    path = tmp_path / "noisy.h5"
    with h5py.File(path, "w") as file:
        for name, rows in (("estimation", 600), ("validation", 200)):
            W = rng.normal(size=(rows, 7))
            file[f"{name}/W"] = W
            file[f"{name}/tau"] = (W @ phi + 0.5 * rng.normal(size=rows)).reshape(-1, 2)
        file["estimation/trajectory"] = np.repeat([0, 1, 2], 100)
    return path


@pytest.mark.parametrize("as_file", [True, False])
def test_settings_without_a_robot(as_file, invoke, noisy, tmp_path):
    """The size is chosen, judged and told, with nothing but matrices."""
    results = tmp_path / "r"
    brought = ("--samples", noisy, "--results", results)
    if as_file:
        path = tmp_path / "settings.yaml"
        path.write_text(SETTINGS)
        invoke("reduce", path, *brought)
        out = invoke("validate", path, *brought).out
    else:
        changes = ["reduction.heuristics=[forward-selection, qr]"]
        invoke("reduce", *brought, settings=changes)
        changes += ["selected.cross_validation=true", "validation.stability=false",
                    "validation.accept.torque_error_validation=0.2"]  # fmt: skip
        out = invoke("validate", *brought, settings=changes).out
    assert "is accepted" in out
    with h5py.File(results / "validation.h5") as file:
        assert file["selected/n"][()] == 3
        assert file["forward-selection/torque_error_validation"][2] == pytest.approx(0.07, abs=0.02)


@pytest.mark.parametrize(
    "key",
    ["selected.acceleration_error", "selected.operations", "validation.accept.operations_direct"],
)
def test_matrices_tell_nothing_of_accelerations_and_functions(key, invoke, noisy, tmp_path):
    brought = ("--samples", noisy, "--results", tmp_path / "r")
    settings = ["reduction.heuristics=[swap@acceleration]"]
    assert (
        "needs a model; give a CONFIG" in invoke("reduce", *brought, settings=settings, code=2).err
    )
    invoke("reduce", *brought, settings=["reduction.heuristics=[qr]"])
    invoke("validate", *brought, settings=["reduction.heuristics=[qr]"], code=1)
    known = (tmp_path / "r" / "validation.h5").read_bytes()
    for stays in (True, False):
        if not stays:
            (tmp_path / "r" / "validation.h5").unlink()
        settings = ["reduction.heuristics=[qr]", f"{key}=100"]
        error = invoke("validate", *brought, settings=settings, code=2).err
        assert key in error
        assert "needs a model" in error
        assert not stays or (tmp_path / "r" / "validation.h5").read_bytes() == known
    assert not (tmp_path / "r" / "validation.h5").exists()


def test_a_page_and_values_without_a_robot(invoke, noisy, tmp_path):
    """The page tells what matrices tell, and the values that are exported predict their torques."""
    results = tmp_path / "r"
    brought = ("--samples", noisy, "--results", results)
    settings = ["reduction.heuristics=[swap, qr]", "selected.heuristic=swap", "selected.n=3",
                "report.formats=[svg]"]  # fmt: skip
    for stage in ("reduce", "validate", "report"):
        invoke(stage, *brought, settings=settings)
    summary = summary_of(results)
    assert summary["model"]["n_base"] == 7
    assert set(summary["selected"]["operations"].values()) == {None}
    page = (results / "report" / "index.html").read_text().split("<script")[0]
    assert "There is no model of the robot" in page
    assert "figure-torques" in page
    assert "operations" not in page
    invoke("export", "--results", results, "--format", "values")
    found = json.loads((results / "export" / "values" / "parameters.json").read_text())
    values = {entry["name"]: entry["value"] for entry in found["parameters"]}
    with h5py.File(noisy) as file:
        matrix, tau = file["validation/W"][:], file["validation/tau"][:]
        scale = file["estimation/tau"][:].std(axis=0)
    phi = np.array([values.get(f"p{k + 1}", 0.0) for k in range(7)])
    residual = (tau.ravel() - matrix @ phi).reshape(tau.shape) / scale
    error = np.linalg.norm(residual) / np.linalg.norm(tau / scale)
    assert error == pytest.approx(summary["selected"]["torque_error"]["validation"])
    invoke("compare", results, results)
    assert "need a CONFIG" in invoke("export", "--results", results, code=2).err
    refused = invoke(
        "export", "--results", results, "--format", "values", "--model", "full", code=2
    )
    assert "need a CONFIG" in refused.err


def test_values_of_a_validation_of_another_reduction_are_not_written(invoke, noisy, tmp_path):
    results = tmp_path / "r"
    brought = ("--samples", noisy, "--results", results)
    invoke("reduce", *brought, settings=["reduction.heuristics=[qr]"])
    invoke("validate", *brought, settings=["selected.n=3", "validation.stability=false"])
    invoke("reduce", *brought, settings=["reduction.heuristics=[swap]"])
    refused = invoke("export", "--results", results, "--format", "values", code=2)
    assert "made with another reduction.h5. Make it again" in refused.err


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("reduction.heuristic=[qr]", "Did you mean heuristics"),
        ("trajectories.count=3", "trajectories"),
        ("selected.n=99", "is 99"),
    ],
)
def test_settings_that_cannot_be(setting, said, invoke, noisy, tmp_path):
    brought = ("--samples", noisy, "--results", tmp_path / "r")
    invoke("reduce", *brought, settings=["reduction.heuristics=[qr]"])
    assert said in invoke("validate", *brought, settings=[setting], code=2).err


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({TAU: None}, "/estimation/tau is missing"),
        ({W: None}, "/estimation/W is missing"),
        ({W: np.where(np.arange(2100).reshape(300, 7) == 52, np.nan, 1.0)}, "not finite"),
        ({"nominal_torque": [1.0, 2.0, 3.0]}, "nominal_torque must hold 2"),
        ({"nominal_torque": [1.0, 0.0]}, "no torque to weigh"),
        ({"parameters/names": ["a", "b"]}, "7 different names"),
        ({TAU: np.zeros((150, 2))}, "no torque to weigh"),
        ({"estimation/trajectory": np.zeros(7)}, "150 finite numbers"),
        ({"estimation/trajectory": np.full(150, -1.0)}, "0, 1, 2"),
        ({"estimation/time": np.full(150, np.nan)}, "150 finite numbers"),
        ({"estimation/z": np.zeros((3, 2))}, "(150, 2)"),
        ({"parameters/names": np.arange(7)}, "must hold text"),
        ({W: np.zeros((300, 7))}, "no column"),
        ({W: np.zeros((0, 7)), TAU: np.zeros((0, 2))}, "empty"),
        ({W: np.full((300, 7), 1e308)}, "too large"),
        ({W: np.ones((300, 7)) * 1j}, "real numbers"),
        ({W: np.ones((4, 30)), TAU: np.eye(2)}, "4 rows are too few for 30 parameters"),
    ],
)
def test_observation_matrices_that_do_not_fit(invoke, brought, tmp_path, changes, says):
    with h5py.File(brought, "a") as file:
        for name, value in changes.items():
            file.pop(name, None)
            if value is not None:
                file[name] = value
    refused = invoke("reduce", "--samples", brought, "--results", tmp_path / "r", code=2)
    assert says in refused.err
    assert not (tmp_path / "r" / "reduction.h5").exists()


def test_triangular_factors_of_others_are_not_trusted(invoke, brought, tmp_path):
    with h5py.File(brought, "a") as file:
        file["estimation/factors"] = np.zeros((1, 2, 8, 8))
    invoke("reduce", "--samples", brought, "--results", tmp_path / "r")
    with h5py.File(tmp_path / "r" / "reduction.h5") as file:
        assert file["rank"][()] == 6


def test_samples_of_another_robot_with_a_config(invoke, brought, two_link_copy):
    reduce = ("reduce", TWO_LINK, "--samples", brought, "--results", two_link_copy)
    assert "another robot" in invoke(*reduce, code=2).err


def test_brought_coefficients_repeat_everything_after_the_optimiser(
    invoke, two_link_results, tmp_path
):
    summary = two_link_results / "report" / "summary.json"
    file = [f"trajectories.file={summary}", ONE_FORMAT]
    invoke("run", TWO_LINK, "--results", tmp_path, "--quiet", settings=file)
    invoke("compare", summary, tmp_path)


def test_brought_coefficients_of_another_robot(invoke, two_link_results, tmp_path):
    file = [f"trajectories.file={two_link_results / 'report' / 'summary.json'}"]
    run = ("run", CONFIGS / "puma560.yaml", "--results", tmp_path)
    assert "2 joints, but puma560 has 6" in invoke(*run, settings=file, code=2).err


def test_brought_states_and_torques(invoke, two_link_results, tmp_path, write_config):
    with h5py.File(two_link_results / "samples.h5") as file:
        for which in ("estimation", "validation", "test"):
            keys = ("time", "z", "dz", "ddz", "tau")
            table = np.column_stack([file[f"{which}/{key}"][:] for key in keys])
            header = ",".join(["t", *(f"{key}{j}" for key in keys[1:] for j in (1, 2))])
            np.savetxt(tmp_path / f"{which}.csv", table, delimiter=",", header=header, comments="")
    sampling = "sampling:\n  estimation_file: estimation.csv\n  validation_file: validation.csv\n\nselected:"
    untested = write_config(("selected:", sampling))
    refused = invoke("run", untested, "--results", tmp_path / "r", code=2).err
    assert "torque_error_test is on a test set, but there is none" in refused
    sampling = sampling.replace("\n\n", "\n  test_file: test.csv\n\n")
    path = write_config(("selected:", sampling))
    run = invoke("run", path, "--results", tmp_path / "r", settings=[ONE_FORMAT])
    assert "optimize-trajectories" not in run.out
    found, expected = (
        summary_of(folder)["selected"]["torque_error"]
        for folder in (tmp_path / "r", two_link_results)
    )
    (tmp_path / "estimation.csv").write_text(
        (tmp_path / "estimation.csv").read_text().replace("tau", "current")
    )
    refused = invoke("run", path, "--results", tmp_path / "r", code=2)
    assert "estimation.csv holds no tau" in refused.err
    invoke("sample", path, "--results", tmp_path / "r", settings=["sampling.torques=model"])
    for which in ("estimation", "validation"):
        assert found[which] == pytest.approx(expected[which], rel=1e-6)
    with h5py.File(tmp_path / "r" / "validation.h5") as file:
        joint = file["forward-selection/torque_error_joint_test"][:]
        assert file["forward-selection/torque_error_test"].shape[1] == 14, (
            "it begins anew where another motion does"
        )
    with h5py.File(two_link_results / "validation.h5") as file:
        np.testing.assert_allclose(
            joint, file["forward-selection/torque_error_joint_test"][:], rtol=1e-6, atol=1e-9
        )
