"""Picking a model, proofs that are kept, and criteria, through the command line."""

import json

import h5py
import numpy as np
import pytest
from conftest import CONFIGS

TWO_LINK = CONFIGS / "two_link.yaml"
ANY = ["--set", "selected.n=null", "--set", "selected.heuristic=null"]
SVG = ["--set", "report.formats=[svg]"]


def summary(folder):
    return json.loads((folder / "report" / "summary.json").read_text())


def validated(invoke, folder, *settings, command="validate"):
    changes = [part for setting in settings for part in ("--set", setting)]
    return invoke(command, TWO_LINK, "--results", folder, *ANY, *changes)


def test_the_smallest_model_within_a_tolerance_is_taken_and_proven(invoke, two_link_copy):
    code, out, _ = validated(invoke, two_link_copy, "selected.torque_error=0.1")
    assert code == 0
    with h5py.File(two_link_copy / "validation.h5") as file:
        heuristic, n = file["selected/heuristic"][()].decode(), int(file["selected/n"][()])
        reason = file["selected/reason"][()].decode()
        errors = {
            name: np.maximum(
                file[f"{name}/torque_error_estimation"][:],
                file[f"{name}/torque_error_validation"][:],
            )
            for name in ("best-subset", "swap", "forward-selection")
        }
    assert heuristic == "best-subset"
    assert all(np.all(e[: n - 1] > 0.1) for e in errors.values())
    assert errors["best-subset"][n - 1] <= 0.1
    assert "proven" in reason
    assert f"n = {n}" in reason
    assert "best-subset" in out


def test_a_tolerance_that_no_model_keeps_is_not_accepted(invoke, two_link_copy):
    code, _, err = validated(
        invoke, two_link_copy, "selected.torque_error=1e-30", "validation.accept={}"
    )
    assert code == 1
    assert "no model has torque error at most" in err


def test_operations_as_a_tolerance(invoke, two_link_copy):
    code, *_ = validated(invoke, two_link_copy, "selected.operations=32", "validation.accept={}")
    assert code == 0
    with h5py.File(two_link_copy / "validation.h5") as file:
        heuristic, n = file["selected/heuristic"][()].decode(), int(file["selected/n"][()])
        assert file[f"{heuristic}/operations_inverse"][n - 1] <= 32
        for name in ("qr", "swap", "best-subset"):
            cheap = file[f"{name}/operations_inverse"][:] <= 32
            error = file[f"{heuristic}/torque_error_estimation"][n - 1]
            assert error <= file[f"{name}/torque_error_estimation"][:][cheap].min() * (1 + 1e-9)


@pytest.mark.parametrize(
    ("setting", "says"),
    [
        ("reduction.heuristics=[swap@speed]", "criterion 'speed' is not known"),
        ("reduction.heuristics=[qr@acceleration]", "qr takes no criterion"),
        ("reduction.heuristics=[swap@torque]", "leave out @torque"),
        ("reduction.heuristics=[swap, swap]", "swap stands there twice"),
        ("selected.heuristic=floating@operations", "does not run"),
        ("reduction.best_subset.time_limit=-1", "greater than or equal to 0"),
    ],
)
def test_mistakes_are_explained(invoke, tmp_path, setting, says):
    code, _, err = invoke("build-model", TWO_LINK, "--results", tmp_path / "r", "--set", setting)
    assert code == 2
    assert says in err


def test_criteria_and_their_names(invoke, two_link_copy):
    wanted = ["swap", "swap@acceleration", "backward-elimination@operations"]
    code, *_ = invoke(
        "run", TWO_LINK, "--results", two_link_copy, *ANY, *SVG, "--quiet",
        "--set", f"reduction.heuristics={json.dumps(wanted)}", "--set", "selected.n=3",
    )  # fmt: skip
    assert code == 0
    found = summary(two_link_copy)
    assert list(found["validation"]) == wanted
    by_torque, by_acceleration = (
        found["validation"][name][2] for name in ("swap", "swap@acceleration")
    )
    assert (
        by_acceleration["acceleration_error"]["estimation"]
        <= by_torque["acceleration_error"]["estimation"]
    )
    assert found["reduction"]["proofs"] == []
    assert found["reduction"]["pareto"]


def proofs(folder):
    with h5py.File(folder / "reduction.h5") as file:
        group = file["proofs"]
        return (
            group["lower_bound"][:], group["torque_error"][:],
            [status.decode() for status in group["status"][:]], int(group["nodes"][:].sum()),
        )  # fmt: skip


def test_proofs_are_continued_on_the_same_data_alone(invoke, two_link_copy):
    """Groups change what is chosen among, but not the data."""
    limited = ["--set", "reduction.best_subset.node_limit=1"]
    grouped = ["--set", 'reduction.groups=[{"name": "g", "bodies": ["upper", "fore"]}]']
    (two_link_copy / "reduction.h5").unlink()
    reduce = ("reduce", TWO_LINK, "--results", two_link_copy, "--quiet")
    assert invoke(*reduce, *limited)[0] == 0
    assert "best-found" in proofs(two_link_copy)[2]
    assert invoke(*reduce, *limited)[0] == 0  # not up to date: more can be proven
    first = proofs(two_link_copy)
    assert invoke(*reduce)[0] == 0
    second = proofs(two_link_copy)
    assert set(second[2]) == {"optimal"}
    assert second[3] > first[3]
    assert np.all(first[0] <= second[1] * (1 + 1e-9) + 1e-12)
    assert invoke(*reduce, *grouped)[0] == 0
    assert invoke(*reduce)[0] == 0
    last = proofs(two_link_copy)
    assert np.allclose(last[1], second[1], atol=1e-12)
    assert np.all(last[0] <= last[1] * (1 + 1e-9))


def test_stability_is_measured(two_link_results):
    with h5py.File(two_link_results / "validation.h5") as file:
        variants = [v.decode() for v in file["stability/variants"][:]]
        chosen, values = file["stability/chosen"][:], file["stability/values"][:]
        n = int(file["selected/n"][()])
    assert variants[0] == "all"
    assert sum(v.startswith("without trajectory") for v in variants) == 2
    assert np.all(chosen.sum(axis=1) == n)
    assert np.array_equal(np.isfinite(values), chosen.astype(bool))
