"""Coordinates whose torques are not measured, such as those of a floating base."""

import h5py
import numpy as np
import pytest
from conftest import ONE_FORMAT, TWO_LINK, config_and_model, summary_of

SETTINGS = ["unmeasured=[z_upper]", "selected.n=2", "validation.accept={}"]


def test_base_parameters_are_those_of_the_rows_that_are_left():
    _, model = config_and_model("two_link", "unmeasured=[z_upper]")
    names = model.mechanism.parameter_names
    # The fore link's own torque knows Izz_fore, mx_fore and my_fore alone.
    assert {names[k] for k in model.base.columns} == {"Izz_fore", "mx_fore", "my_fore"}
    assert np.isinf(model.nominal_torque).tolist() == [True, False]


@pytest.mark.parametrize("weighting", ["nominal-torque", "none"])
def test_fits_and_errors_leave_their_rows_out(invoke, tmp_path, weighting):
    settings = [*SETTINGS, ONE_FORMAT, f"reduction.weighting={weighting}"]
    invoke("run", TWO_LINK, "--results", tmp_path, settings=settings)
    with h5py.File(tmp_path / "samples.h5") as file:
        W, tau = file["estimation/W"][1::2], file["estimation/tau"][:, 1]
    summary = summary_of(tmp_path)
    rows = summary["validation"]["best-subset"]
    with h5py.File(tmp_path / "reduction.h5") as file:
        subset = file["best-subset/subsets/2"][()]
    kept = np.flatnonzero(np.linalg.norm(W, axis=0))
    best = min(
        np.linalg.norm(tau - W[:, [i, j]] @ np.linalg.lstsq(W[:, [i, j]], tau, rcond=None)[0])
        for i in kept
        for j in kept
        if i < j
    )
    error = next(row["torque_error"] for row in rows if row["n"] == 2)
    assert error["estimation"] == pytest.approx(best / np.linalg.norm(tau), rel=1e-8)
    assert error["joints_estimation"][0] is None
    assert error["joints_estimation"][1] == pytest.approx(error["estimation"])
    assert len(subset) == 2
    invoke("export", TWO_LINK, "--results", tmp_path, settings=settings)
    header = (tmp_path / "export" / "c" / "two_link.h").read_text()
    assert "NOT PREDICTED, as not measured: the torques of z_upper" in header


@pytest.mark.parametrize("unmeasured", [True, False])
def test_recordings_may_lack_what_is_not_measured(invoke, tmp_path, unmeasured):
    names = ["t", "z1", "z2", "dz1", "dz2", "ddz1", "ddz2", "tau2"]
    rng = np.random.default_rng(0)
    rows = np.column_stack([np.arange(60) / 10, rng.normal(size=(60, 7))])
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header=",".join(names), comments="")
    file = tmp_path / "log.csv"
    files = [f"sampling.estimation_file={file}", f"sampling.validation_file={file}"]
    given = (TWO_LINK, "--results", tmp_path / "r")
    if unmeasured:
        settings = [*files, "unmeasured=[z_upper]", "selected.n=2", "validation.accept={}"]
        invoke("run", *given, settings=[*settings, ONE_FORMAT])
        page = (tmp_path / "r" / "report" / "index.html").read_text()
        assert "Torques of z_upper are not measured" in page
    else:
        out = invoke("run", *given, settings=[*files, "validation.accept={}"], code=2)
        assert "there is no tau1" in " ".join(out.err.split())


@pytest.mark.parametrize(
    ("value", "says"),
    [("[z_uper]", "Did you mean z_upper"), ("[z_upper, z_fore]", "leaves no measured torque")],
)
def test_wrong_names_are_refused(invoke, tmp_path, value, says):
    out = invoke(
        "build-model", TWO_LINK, "--results", tmp_path, settings=[f"unmeasured={value}"], code=2
    )
    assert says in out.err
