import gzip
import json

import h5py
import numpy as np
import pytest

from paramreduce_cli.artifacts.brought import load_coefficients, load_recording
from paramreduce_cli.errors import ArtifactError, DataError

HEADER = "t,z1,z2,dz1,dz2,ddz1,ddz2,tau1,tau2"


def table(rows=20, columns=9):
    return np.random.default_rng(0).normal(size=(rows, columns))


def write_csv(path, header=HEADER, data=None):
    data = table() if data is None else data
    text = "\n".join([header, *(",".join(repr(float(x)) for x in row) for row in data)]) + "\n"
    if path.suffix == ".gz":
        path.write_bytes(gzip.compress(text.encode()))
    else:
        path.write_text(text)
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
        (HEADER.replace("tau2", "torque2"), None, "lacks tau2"),
        (HEADER, table(3), "3 samples are too few"),
        (HEADER, np.where(np.arange(180).reshape(20, 9) == 58, np.nan, table()), "data row 7"),
        (HEADER, np.where(np.arange(180).reshape(20, 9) == 58, np.inf, table()), "data row 7"),
        (HEADER + ",extra", None, "line 2: 9 values under 10 headings"),
    ],
)
def test_csv_that_does_not_fit_is_refused(tmp_path, header, data, says):
    with pytest.raises(DataError, match=says):
        load_recording(write_csv(tmp_path / "x.csv", header, data), 2)


def test_text_among_the_numbers_is_named_by_line(tmp_path):
    path = write_csv(tmp_path / "x.csv")
    lines = path.read_text().splitlines()
    lines[4] = lines[4].replace(lines[4].split(",")[2], "n/a")
    path.write_text("\n".join(lines))
    with pytest.raises(DataError, match="line 5: 'n/a' is not a number"):
        load_recording(path, 2)


@pytest.mark.parametrize("name", ["none.csv", "none.h5"])
def test_files_that_are_not_there(tmp_path, name):
    with pytest.raises(ArtifactError, match="no such file"):
        load_recording(tmp_path / name, 2)


def test_tables_as_spreadsheets_write_them(tmp_path):
    path = write_csv(tmp_path / "x.csv")
    text = path.read_text()
    path.write_text("\ufeff" + text)
    assert np.array_equal(load_recording(path, 2).time, table()[:, 0])
    path.write_text(text.replace(",", ";"))
    with pytest.raises(DataError, match="separated by commas"):
        load_recording(path, 2)
    path.write_text(text.replace("dz2", "z2", 1))
    with pytest.raises(DataError, match="z2 stands there twice"):
        load_recording(path, 2)


def test_a_compressed_file_that_is_cut_off(tmp_path):
    path = write_csv(tmp_path / "x.csv.gz")
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(ArtifactError, match="cannot be read"):
        load_recording(path, 2)


@pytest.mark.parametrize(("key", "shape"), [("time", (14,)), ("time", (15, 3)), ("z", ())])
def test_datasets_of_another_shape_are_refused(tmp_path, key, shape):
    path = tmp_path / "x.h5"
    with h5py.File(path, "w") as file:
        for name in ("z", "dz", "ddz"):
            file[name] = table(15, 3)
        if key in file:
            del file[key]
        file[key] = np.zeros(shape)
    with pytest.raises(DataError, match=key):
        load_recording(path, 3)


def test_empty_and_binary_files(tmp_path):
    (tmp_path / "x.csv").write_text("")
    with pytest.raises(DataError, match="line 1"):
        load_recording(tmp_path / "x.csv", 2)
    (tmp_path / "y.csv").write_bytes(b"\xff\xfe\x00\x01" * 10)
    with pytest.raises(ArtifactError, match="cannot be read"):
        load_recording(tmp_path / "y.csv", 2)


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
