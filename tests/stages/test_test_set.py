"""The test set: what it holds, that no search looks at it, and that errors on it are what they are called."""

import json
import shutil

import h5py
import numpy as np
import pytest
from conftest import ROUGH_TERMS, TWO_LINK, config_and_model, run_stages, summary_of

from paramreduce_cli.artifacts.user_files import load_coefficients
from paramreduce_cli.errors import ParamreduceWarning
from paramreduce_cli.excitation.point_to_point import (
    evaluate_point_to_point,
    sample_point_to_point_times,
)
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.records import Items, Run
from paramreduce_cli.stages.optimize_trajectories import optimize_trajectories

QUICK = ("trajectories.starts=1", "trajectories.polished=1", "trajectories.max_iterations=30")
OTHER_TEST_SETS = ["trajectories.test_count=0", "trajectories.test_point_to_point_count=3"]


def test_errors_are_those_of_each_motion(two_link_results, summary):
    with h5py.File(two_link_results / "samples.h5") as file:
        names = [name.decode() for name in file["parameters/names"]]
        nominal = file["nominal_torque"][:]
        owner, tau = file["test/trajectory"][:], file["test/tau"][:]
        W = file["test/W"][:].reshape(*tau.shape, -1)
    phi = np.array([summary["selected"]["parameters"].get(name, 0.0) for name in names])
    errors = []
    for motion in range(14):
        own = owner == motion
        missed = (W[own] @ phi - tau[own]) / nominal
        errors.append(np.linalg.norm(missed) / np.linalg.norm(tau[own] / nominal))
    found = summary["selected"]["torque_error"]["test"]
    expected = {"median": np.median(errors), "least": min(errors), "worst": max(errors)}
    assert found == pytest.approx(expected, rel=1e-6)


def test_accelerations_are_those_of_each_motion(two_link_results, summary):
    """Each predicted from M ddz + delta = tau with the reduced parameters, one sample at a time."""
    _, model = config_and_model("two_link")
    dynamics = Dynamics(model.mechanism)
    with h5py.File(two_link_results / "samples.h5") as file:
        nominal = file["nominal_acceleration"][:]
        owner, states = file["test/trajectory"][:], {key: file[f"test/{key}"][:] for key in ("z", "dz", "ddz", "tau")}  # fmt: skip
    parameters = summary["selected"]["parameters"]
    phi = np.array([parameters.get(name, 0.0) for name in model.mechanism.parameter_names])
    errors = []
    for motion in range(14):
        missed, size = 0.0, 0.0
        for k in np.flatnonzero(owner == motion):
            M, delta = (v[0] for v in dynamics.compute_mass_matrix_and_bias(states["z"][k : k + 1], states["dz"][k : k + 1], phi))  # fmt: skip
            ddz = np.linalg.solve(M, states["tau"][k] - delta)
            missed += np.sum(((ddz - states["ddz"][k]) / nominal) ** 2)
            size += np.sum((states["ddz"][k] / nominal) ** 2)
        errors.append(np.sqrt(missed / size))
    found = summary["selected"]["acceleration_error"]["test"]
    assert found["median"] == pytest.approx(np.median(errors), rel=1e-6)
    assert found["worst"] == pytest.approx(max(errors), rel=1e-6)


def test_no_search_looks_at_it(tmp_path):
    """With another test set, everything that is found and chosen is the same, bit by bit."""
    found = []
    for folder, others in (("a", []), ("b", OTHER_TEST_SETS)):
        run_stages(tmp_path / folder, *QUICK, *ROUGH_TERMS, *others)
        one = summary_of(tmp_path / folder)
        found.append(one)
    a, b = found
    assert a["selected"]["torque_error"]["test"] != b["selected"]["torque_error"]["test"]
    assert a["reduction"]["swap"]["subsets"] == b["reduction"]["swap"]["subsets"]
    assert a["selected"]["parameters"] == b["selected"]["parameters"]
    assert a["selected"]["reason"] == b["selected"]["reason"]
    for one, two in zip(a["terms"], b["terms"], strict=True):
        assert one["parameters"] == two["parameters"]
        assert one["operations"] == two["operations"]
        assert one["torque_error"]["validation"] == two["torque_error"]["validation"]


def test_limits_on_it_are_judged(invoke, tmp_path, two_link_results):
    shutil.copytree(two_link_results, tmp_path / "r")
    errors = summary_of(two_link_results)["selected"]["torque_error"]["test"]
    for key, error in (("torque_error_test", errors["median"]), ("torque_error_test_worst", errors["worst"])):  # fmt: skip
        for factor, code in ((1.001, 0), (0.999, 1)):
            settings = [f"validation.accept={{{key}: {factor * error}}}"]
            said = invoke("validate", TWO_LINK, "--results", tmp_path / "r", settings=settings, code=code)  # fmt: skip
            assert key.replace("_", " ") in said.out + said.err


@pytest.mark.parametrize(
    ("settings", "instead"),
    [
        (["trajectories.test_count=0", "trajectories.test_point_to_point_count=0"], "trajectories.test_count"),
        (["sampling.estimation_file=a.csv", "sampling.validation_file=b.csv"], "torque_error_validation"),
    ],
)  # fmt: skip
def test_limits_on_a_set_that_will_not_be_there_are_refused_at_once(
    invoke, tmp_path, settings, instead
):
    said = invoke("run", TWO_LINK, "--results", tmp_path / "r", settings=settings, code=2).err
    assert "validation.accept.torque_error_test is on a test set, but there is none" in said
    assert instead in said
    assert not (tmp_path / "r").exists()


def test_without_it_errors_are_those_of_the_validation_set(tmp_path, invoke):
    none = [
        "trajectories.test_count=0",
        "trajectories.test_point_to_point_count=0",
        "validation.accept={}",
    ]
    out = invoke("run", TWO_LINK, "--results", tmp_path, settings=[*QUICK, *none]).out
    assert "on the estimation and on the validation set" in out
    assert "test set" not in out
    assert summary_of(tmp_path)["selected"]["torque_error"]["test"] is None
    assert "which no search uses: median" not in (tmp_path / "report" / "index.html").read_text()


def test_brought_coefficients_with_and_without_one(two_link_results, tmp_path):
    """Of those without one, point-to-point motions are between positions of the validation set."""
    summary = summary_of(two_link_results)
    for with_one in (True, False):
        path = tmp_path / f"{with_one}.json"
        own = dict(summary["trajectories"])
        if not with_one:
            del own["test"]
        path.write_text(json.dumps({"trajectories": own}))
        coefficients = load_coefficients(path)
        config, model = config_and_model("two_link")
        found = optimize_trajectories(config.trajectories, model, coefficients, Run(), Items())
        assert len(found.test) == (4 if with_one else 0)
        assert len(found.test_point_to_point) == 10
        known = summary["trajectories"]["test_point_to_point"]
        same = np.allclose(
            [m.start for m in found.test_point_to_point], [m["start"] for m in known]
        )
        assert same == with_one


def test_motions_of_the_test_set_keep_to_the_limits(two_link_results):
    config, _ = config_and_model("two_link")
    limits = config.trajectories.build_limits(2)
    with h5py.File(two_link_results / "samples.h5") as file:
        z, dz = file["test/z"][:], file["test/dz"][:]
    assert np.all(z >= limits.lower - 1e-9)
    assert np.all(z <= limits.upper + 1e-9)
    assert np.all(np.abs(dz) <= limits.velocity * (1 + 1e-9))


def test_motions_keep_to_torque_limits_and_too_few_are_said(monkeypatch):
    limits = np.array([17, 5])
    config, model = config_and_model(
        "two_link",
        *QUICK,
        "trajectories.test_count=1",
        f"trajectories.torque_limits={limits.tolist()}",
    )
    found = optimize_trajectories(config.trajectories, model, None, Run(), Items())
    dynamics = Dynamics(model.mechanism)
    assert len(found.test_point_to_point) == 10
    for motion in found.test_point_to_point:
        states = evaluate_point_to_point(motion, sample_point_to_point_times(motion, 300))
        assert (np.abs(dynamics.compute_torques(*states, model.values)) <= 1.01 * limits).all()
    monkeypatch.setattr("paramreduce_cli.excitation.point_to_point._TRIES", 0)
    with pytest.warns(ParamreduceWarning, match="^0 of 10 point-to-point motions of the test set"):
        optimize_trajectories(config.trajectories, model, None, Run(), Items())
