"""Picking a model, proofs that are kept, and criteria, through the command line."""

import json

import h5py
import numpy as np
import pytest
from conftest import CONFIGS, TWO_LINK, summary_of

ANY = ["selected.n=null", "selected.heuristic=null"]


@pytest.fixture
def validate(invoke, two_link_copy):
    validate = ("validate", TWO_LINK, "--results", two_link_copy)
    return lambda *settings, code=0: invoke(*validate, settings=[*ANY, *settings], code=code)


def test_the_smallest_model_within_a_tolerance_is_taken_and_proven(validate, two_link_copy):
    out = validate("selected.torque_error=0.1", "validation.accept={}").out
    with h5py.File(two_link_copy / "validation.h5") as file:
        heuristic, n = file["selected/heuristic"][()].decode(), int(file["selected/n"][()])
        reason = file["selected/reason"][()].decode()
        both = ("estimation", "validation")
        errors = {
            name: np.max([file[f"{name}/torque_error_{which}"] for which in both], axis=0)
            for name in ("best-subset", "swap", "forward-selection")
        }
    assert heuristic == "best-subset"
    assert all(np.all(e[: n - 1] > 0.1) for e in errors.values())
    assert errors["best-subset"][n - 1] <= 0.1
    assert "proven" in reason
    assert f"n = {n}" in reason
    assert "best-subset" in out


def test_a_tolerance_that_no_model_keeps_is_not_accepted(validate):
    refused = validate("selected.torque_error=1e-30", "validation.accept={}", code=1)
    assert "no model has torque error at most" in refused.err


def test_operations_as_a_tolerance(validate, two_link_copy):
    validate("selected.operations=32", "validation.accept={}")
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
        ("reduction.heuristics=[swap@speed]", "unknown criterion 'speed'"),
        ("reduction.heuristics=[qr@acceleration]", "qr takes no criterion"),
        ("reduction.heuristics=[swap@torque]", "leave out @torque"),
        ("reduction.heuristics=[swap, swap]", "swap is listed twice"),
        ("selected.heuristic=floating@operations", "does not run"),
        ("reduction.best_subset.time_limit=-1", "greater than or equal to 0"),
    ],
)
def test_mistakes_are_explained(invoke, tmp_path, setting, says):
    build = ("build-model", TWO_LINK, "--results", tmp_path / "r")
    assert says in invoke(*build, settings=[setting], code=2).err


def test_criteria_and_their_names(invoke, two_link_copy):
    wanted = ["swap", "swap@acceleration", "backward-elimination@operations"]
    heuristics = f"reduction.heuristics={json.dumps(wanted)}"
    settings = [*ANY, "report.formats=[svg]", heuristics, "selected.n=3"]
    invoke("run", TWO_LINK, "--results", two_link_copy, "--quiet", settings=settings)
    found = summary_of(two_link_copy)
    assert list(found["validation"]) == wanted
    errors = [found["validation"][name][2]["acceleration_error"] for name in wanted]
    assert errors[1]["estimation"] <= errors[0]["estimation"]
    assert found["reduction"]["proofs"] == []
    assert found["reduction"]["pareto"]


def proofs(folder):
    with h5py.File(folder / "reduction.h5") as file:
        group = file["proofs"]
        return (
            group["lower_bound"][:], group["torque_error"][:],
            [status.decode() for status in group["status"][:]], int(group["nodes"][:].sum()),
        )  # fmt: skip


def test_proofs_are_continued_on_the_same_data_alone(invoke, tmp_path):
    """Groups change what is chosen among, but not the data."""
    four_bar = (CONFIGS / "four_bar.yaml", "--results", tmp_path, "--quiet")
    limited = ["reduction.best_subset.node_limit=1"]
    grouped = ['reduction.groups=[{"name": "g", "bodies": ["crank", "rocker"]}]']
    for stage in ("build-model", "optimize-trajectories", "sample"):
        invoke(stage, *four_bar)
    invoke("reduce", *four_bar, settings=limited)
    assert {"best-found", "optimal", "beyond-rank"} == set(proofs(tmp_path)[2])
    invoke("reduce", *four_bar, settings=limited)  # not up to date: more can be proven
    first = proofs(tmp_path)
    invoke("reduce", *four_bar)
    second = proofs(tmp_path)
    assert set(second[2]) == {"optimal", "beyond-rank"}
    assert second[3] > first[3]
    assert np.all(first[0] <= second[1] * (1 + 1e-9) + 1e-12)
    invoke("reduce", *four_bar, settings=grouped)
    invoke("reduce", *four_bar)
    last = proofs(tmp_path)
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
