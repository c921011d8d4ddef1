import json

import h5py
import numpy as np
import pytest

from paramreduce_cli.artifacts.user_files import load_coefficients, load_recording
from paramreduce_cli.errors import ArtifactError, DataError

HEADER = "t,z1,z2,dz1,dz2,ddz1,ddz2,tau1,tau2"


def table(rows=20, columns=9):
    data = np.random.default_rng(0).normal(size=(rows, columns))
    data[:, 0].sort()  # time goes on
    return data


def write_csv(path, header=HEADER, data=None):
    data = table() if data is None else data
    np.savetxt(path, data, delimiter=",", header=header, comments="")
    return path


@pytest.mark.parametrize("name", ["x.csv", "x.csv.gz"])
def test_states_and_torques_from_csv(tmp_path, name):
    data = table()
    found = load_recording(write_csv(tmp_path / name, data=data), 2)
    assert np.array_equal(found.time, data[:, 0])
    assert np.array_equal(found.dz, data[:, 3:5])
    assert np.array_equal(found.tau, data[:, 7:9])


def test_states_alone_in_any_order(tmp_path):
    path = write_csv(tmp_path / "x.csv", "ddz2,ddz1,z1,z2,dz1,dz2", table(12, 6))
    found = load_recording(path, 2)
    assert found.tau is None
    assert np.array_equal(found.ddz[:, 0], table(12, 6)[:, 1])


def test_states_from_hdf5(tmp_path):
    path = tmp_path / "x.h5"
    with h5py.File(path, "w") as file:
        for key in ("z", "dz", "ddz"):
            file[key] = table(15, 3)
    assert load_recording(path, 3).z.shape == (15, 3)
    with pytest.raises(DataError, match="2 joints"):
        load_recording(path, 2)


@pytest.mark.parametrize(
    ("header", "data", "says"),
    [
        (HEADER.replace("ddz2", "acc2"), None, "line 1: the header lacks ddz2"),
        (HEADER, table(3), "3 samples are too few"),
        (HEADER, np.where(np.arange(180).reshape(20, 9) == 58, np.nan, table()), "data row 7"),
        (HEADER, np.where(np.arange(180).reshape(20, 9) == 58, np.inf, table()), "data row 7"),
        (HEADER.replace("dz1", "z3", 1), None, "a column z3, but the robot has 2 joints"),
        (HEADER, table()[::-1], "the time does not go on from data row 1 to 2"),
        (HEADER, table() * [0, 1, 1, 1, 1, 1, 1, 1, 1], "the time does not go on"),
        (HEADER + ",extra", None, "line 2: 9 values under 10 headings"),
    ],
)
def test_csv_that_does_not_fit_is_refused(tmp_path, header, data, says):
    with pytest.raises(DataError, match=says):
        load_recording(write_csv(tmp_path / "x.csv", header, data), 2)


@pytest.mark.parametrize(
    ("name", "change", "error", "says"),
    [
        ("x.csv", lambda b: b.replace(b"%.18e" % table()[3, 2], b"n/a"), DataError,
         r"line 5, column \w+: 'n/a' is not a number"),
        ("x.csv", lambda b: b.replace(b",", b";").replace(b".", b",", 3), DataError, "Write decimal points"),
        ("x.csv", lambda b: b.replace(b"dz2", b"z2", 1), DataError, "z2 is listed twice"),
        ("x.csv", lambda b: b"", DataError, "line 1"),
        ("x.csv", lambda b: b"\x80\xfe\x00\x01" * 10, ArtifactError, "cannot be read"),
        ("x.csv.gz", lambda b: b[:-40], ArtifactError, "cannot be read"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_table_is_said(tmp_path, name, change, error, says):
    path = write_csv(tmp_path / name)
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(error, match=says):
        load_recording(path, 2)


@pytest.mark.parametrize("name", ["none.csv", "none.h5"])
def test_files_that_are_not_there(tmp_path, name):
    with pytest.raises(ArtifactError, match="no such file"):
        load_recording(tmp_path / name, 2)


def test_tables_as_spreadsheets_write_them(tmp_path):
    path = write_csv(tmp_path / "x.csv", f"\ufeff{HEADER}")
    assert np.array_equal(load_recording(path, 2).time, table()[:, 0])


@pytest.mark.parametrize(("key", "shape"), [("time", (14,)), ("time", (15, 3)), ("z", ())])
def test_datasets_of_another_shape_are_refused(tmp_path, key, shape):
    path = tmp_path / "x.h5"
    with h5py.File(path, "w") as file:
        for name in ("z", "dz", "ddz"):
            file[name] = table(15, 3)
        file.pop(key, None)
        file[key] = np.zeros(shape)
    with pytest.raises(DataError, match=key):
        load_recording(path, 3)


def test_coefficients_from_a_summary_and_from_hdf5_are_the_same(two_link_results):
    one = load_coefficients(two_link_results / "report" / "summary.json")
    two = load_coefficients(two_link_results / "trajectories.h5")
    assert np.array_equal(one.estimation, two.estimation)
    assert np.array_equal(one.validation, two.validation)
    assert one.period == two.period


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"period": -1}, "period"),
        ({"estimation": []}, "estimation"),
        ({"estimation": [{"coefficients": [[1, 2, 3, 4]]}]}, "odd count"),
        ({"estimation": [{"coefficients": [[1, 2, None]]}]}, "finite"),
        ({"estimation": [{"coefficients": [[1], [2, 3]]}]}, "no Fourier coefficients"),
        ({"validation": None}, "no Fourier coefficients"),
    ],
)
def test_coefficients_that_do_not_fit_are_refused(tmp_path, change, says):
    good = {"period": 6.28, "estimation": [{"coefficients": [[0, 1, 2]]}],
            "validation": [{"coefficients": [[0, 1, 2]]}]}  # fmt: skip
    path = tmp_path / "x.json"
    path.write_text(json.dumps({"trajectories": {**good, **change}}))
    with pytest.raises(DataError, match=says):
        load_coefficients(path)
