import dataclasses
import itertools
import json
import os
import resource
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from conftest import ONE_FORMAT, TWO_LINK, config_of
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from paramreduce_cli.artifacts import hdf5, sample_files
from paramreduce_cli.artifacts.atomic import remove_leftovers, replace_atomically
from paramreduce_cli.artifacts.hdf5 import SCHEMA, Stamp, Writer, open_reader, read_stamp, write
from paramreduce_cli.artifacts.plain_data import from_plain, to_plain
from paramreduce_cli.artifacts.store import LAYOUTS, Store, load_file
from paramreduce_cli.artifacts.stored_items import StoredItems
from paramreduce_cli.errors import ArtifactError
from paramreduce_cli.records import (
    Identification,
    MeasuredLog,
    Mechanism,
    Model,
    Reduction,
    Samples,
    TermReduction,
    Trajectories,
    Validation,
)
from paramreduce_cli.running.pipeline import list_stages
from paramreduce_cli.running.runner import Runner

VERSIONS = {"paramreduce": "1", "numpy": "2", "scipy": "1", "casadi": "3"}
STAMP = Stamp(SCHEMA, "arm", "build-model", VERSIONS, {"model": "abc"}, {"x.h5": "def"}, 3, 1.5)
SAMPLE = [sys.executable, "-m", "paramreduce_cli", "sample", TWO_LINK, "--force", "--quiet"]


def same(a, b):
    if dataclasses.is_dataclass(a):
        return all(same(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a))
    if isinstance(a, np.ndarray):
        return np.array_equal(a, b, equal_nan=True)
    if isinstance(a, dict):
        return same(tuple(a.items()), tuple(b.items()))
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(same, a, b))
    return a == b


@pytest.mark.parametrize("record", [Model, Trajectories, Reduction, Validation])
def test_records_survive_being_written_and_read(record, two_link_copy):
    store = Store(two_link_copy)
    first, made = load_file(store.get_path(record), record, "two_link", "")
    store.save(first, made)
    second, again = load_file(store.get_path(record), record, "two_link", "")
    assert same(first, second)
    assert again.digest == made.digest


def test_samples_are_what_the_layout_says(two_link_results):
    with h5py.File(two_link_results / "samples.h5") as file:
        z, W, tau = (file[f"estimation/{key}"][:] for key in ("z", "W", "tau"))
        phi = file["parameters/values"][:]
        t = file["estimation/time"][:]
        assert z.shape == (80, 2)
        assert W.shape == (160, 20)
        assert np.allclose((W @ phi).reshape(-1, 2), tau, atol=1e-13)
        assert t[:40] == pytest.approx(np.arange(40) * 2 * np.pi / 40)
        with h5py.File(two_link_results / "trajectories.h5") as series:
            q0, a1, b1, a2, b2 = series["estimation/coefficients"][0, 1]
        t = t[:40]
        expected = q0 + a1 * np.sin(t) - b1 * np.cos(t)
        expected += a2 / 2 * np.sin(2 * t) - b2 / 2 * np.cos(2 * t)
        assert z[:40, 1] == pytest.approx(expected)


def test_a_mechanism_survives_as_text(mechanism):
    text = json.dumps(to_plain(mechanism), allow_nan=False)
    assert same(from_plain(Mechanism, json.loads(text)), mechanism)


def test_names_relied_on_outside(two_link_results):
    expected = {
        "model.h5": ["parameters/names", "parameters/values", "parameters/affecting", "base/columns",
                     "base/beta", "coordinates/names", "nominal_torque", "mechanism"],
        "trajectories.h5": ["estimation/coefficients", "validation/coefficients",
                            "estimation/condition_number"],
        "samples.h5": [f"{s}/{k}" for s in ("estimation", "validation")
                       for k in ("time", "z", "dz", "ddz", "tau", "W")] + ["nominal_acceleration"],
        "reduction.h5": ["qr/order", "qr/torque_error", "qr/parameters/3", "qr/seconds"],
        "validation.h5": [f"qr/{k}" for k in (
            "n", "torque_error_estimation", "torque_error_validation", "acceleration_error_estimation",
            "acceleration_error_validation", "operations_inverse", "operations_direct",
            "mass_matrix_condition")],
    }  # fmt: skip
    for name, datasets in expected.items():
        with h5py.File(two_link_results / name) as file:
            assert not [d for d in datasets if d not in file]
            for attribute in ("schema", "robot", "stage", "paramreduce_version", "numpy_version",
                              "config_sections", "inputs", "seed", "wall_seconds", "cut_short"):  # fmt: skip
                assert attribute in file.attrs
    with h5py.File(two_link_results / "trajectories.h5") as file:
        assert file.attrs["period"] == pytest.approx(2 * np.pi)
    with h5py.File(two_link_results / "model.h5") as file:
        assert file["base/beta"].shape == (6, 14)


def test_a_failed_write_leaves_the_old_file_and_no_litter(tmp_path):
    path = tmp_path / "x.h5"
    write(path, STAMP, lambda w: w.write_dataset("a", 1))
    before = path.read_bytes()

    def fail(writer: Writer) -> None:
        writer.write_dataset("a", 2)
        raise OSError(28, "No space left on device")

    with pytest.raises(ArtifactError, match="disk is full"):
        write(path, STAMP, fail)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["x.h5"]


def test_a_disk_that_fills_up(two_link_copy):
    """A limit on file size stands in for a full disk; the old samples must survive."""
    samples = two_link_copy / "samples.h5"
    before = samples.read_bytes()

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

    command = [*SAMPLE, "--results", two_link_copy]
    done = subprocess.run(command, capture_output=True, text=True, preexec_fn=limit, check=False)
    assert done.returncode == 2
    assert "samples.h5: cannot be written" in done.stderr
    assert "Traceback" not in done.stderr
    assert samples.read_bytes() == before
    assert not list(two_link_copy.glob(".*.tmp"))


def test_temporary_files_of_kills_go_but_not_those_that_a_job_may_be_writing(tmp_path):
    shares = tmp_path / "samples.h5.items"
    shares.mkdir()
    new, old = shares / ".new.h5.abcd1234.tmp", shares / ".old.h5.abcd1234.tmp"
    left = tmp_path / ".samples.h5.abcd1234.tmp"
    for path in (new, old, left):
        path.touch()
    os.utime(old, (1e9, 1e9))
    remove_leftovers(tmp_path)
    assert [path.exists() for path in (new, old, left)] == [True, False, False]


def test_what_a_kill_has_left_of_a_file_goes_when_it_is_written_again(tmp_path):
    new, old, other = (
        tmp_path / name for name in (".x.c.abcd1234.tmp", ".x.c.abcd5678.tmp", ".y.c.abcd5678.tmp")
    )
    for path in (new, old, other):
        path.touch()
    for path in (old, other):
        os.utime(path, (1e9, 1e9))
    with replace_atomically(tmp_path / "x.c") as temporary:
        temporary.write_text("int x;")
    assert [path.exists() for path in (new, old, other)] == [True, False, True]


def make_foreign(path):
    with h5py.File(path, "w") as file:
        file["something"] = 1.0


DAMAGES = {
    "missing": Path.unlink,
    "truncated": lambda path: path.write_bytes(path.read_bytes()[:1000]),
    "foreign": make_foreign,
    "text": lambda path: path.write_text("z1,z2\n1,2\n"),
    "empty": lambda path: path.write_bytes(b""),
}


@pytest.mark.parametrize("damage", list(DAMAGES))
@pytest.mark.parametrize("record", list(LAYOUTS))
def test_files_that_cannot_be_used_are_refused(record, damage, two_link_copy, request):
    folder = two_link_copy
    if record in (MeasuredLog, Identification, TermReduction):
        folder = request.getfixturevalue("measured_copy") / "results"
    path = Store(folder).get_path(record)
    DAMAGES[damage](path)
    with pytest.raises(ArtifactError, match=path.name):
        load_file(path, record, "two_link", "make-it")


@pytest.mark.parametrize(
    ("record", "dataset"),
    [(Model, "base/beta"), (Trajectories, "validation/coefficients"), (Samples, "estimation/W"),
     (Reduction, "qr/n"), (Validation, "qr/n")],
)  # fmt: skip
def test_a_file_without_one_of_its_datasets_is_refused(record, dataset, two_link_copy):
    path = Store(two_link_copy).get_path(record)
    with h5py.File(path, "a") as file:
        del file[dataset]
    with pytest.raises(ArtifactError, match=dataset):
        load_file(path, record, "two_link", "")


def test_a_large_observation_matrix_is_computed_again(two_link_copy, monkeypatch):
    store = Store(two_link_copy)
    (sample,) = (stage for stage in list_stages() if stage.name == "sample")
    kept, _ = load_file(store.get_path(Samples), Samples, "two_link", "")
    expected = [block.W for block in kept.validation.iterate_blocks()]
    monkeypatch.setattr(sample_files, "_MOST_KEPT", 0)
    Runner(config_of("two_link", ONE_FORMAT), store).run(sample, force=True)

    with h5py.File(store.get_path(Samples)) as file:
        assert "W" not in file["validation"]
    found, _ = load_file(store.get_path(Samples), Samples, "two_link", "")
    for block, W in zip(found.validation.iterate_blocks(), expected, strict=True):
        np.testing.assert_array_equal(block.W, W)

    with h5py.File(store.get_path(Model), "a") as file:
        file.attrs["digest"] = "another"
    changed, _ = load_file(store.get_path(Samples), Samples, "two_link", "")
    with pytest.raises(ArtifactError, match=r"is not the model that .* was computed with"):
        next(changed.validation.iterate_blocks())


def test_another_robots_file_and_an_older_schema_are_refused(two_link_copy):
    path = Store(two_link_copy).get_path(Model)
    with pytest.raises(ArtifactError, match="belongs to the robot two_link, not to other"):
        load_file(path, Model, "other", "")
    with h5py.File(path, "a") as file:
        file.attrs["schema"] = SCHEMA - 1
    with pytest.raises(ArtifactError, match=r"older layout.*paramreduce run"):
        load_file(path, Model, "two_link", "")


def test_one_run_at_a_time(tmp_path):
    store = Store(tmp_path)
    with store.lock(), pytest.raises(ArtifactError, match="another run"), store.lock():
        pass
    with store.lock():
        pass


def test_a_run_can_be_waited_for(tmp_path):
    store, order = Store(tmp_path), []
    inside = threading.Event()

    def first():
        with store.lock("-part"):
            inside.set()
            time.sleep(0.2)
            order.append("first")

    thread = threading.Thread(target=first)
    thread.start()
    inside.wait()
    with store.lock("-part", wait=True):
        order.append("second")
    thread.join()
    assert order == ["first", "second"]


def test_items_belong_to_one_origin(two_link_results, tmp_path):
    path = Store(two_link_results).get_path(Trajectories)
    trajectories, _ = load_file(path, Trajectories, "two_link", "")
    items = StoredItems(tmp_path / "x.h5", lambda seconds: STAMP)
    items["a"], items["b"], items["c"] = trajectories.estimation[0], None, np.arange(3)
    assert same(items["a"], trajectories.estimation[0])
    assert items["b"] is None
    assert items["c"].tolist() == [0, 1, 2]
    assert list(items) == ["a", "b", "c"]
    other = dataclasses.replace(STAMP, sections={"model": "changed"})
    assert "a" not in StoredItems(tmp_path / "x.h5", lambda seconds: other)
    assert "a" not in StoredItems(tmp_path / "x.h5", lambda seconds: STAMP, from_start=True)
    (tmp_path / "x.h5.items" / "a.h5").write_bytes(b"cut off")
    assert "a" not in items
    items.clear()
    assert not (tmp_path / "x.h5.items").exists()


def test_stamp_survives(tmp_path):
    made = write(tmp_path / "x.h5", STAMP, lambda w: w.write_dataset("a", [1.0, 2.0]))
    assert read_stamp(tmp_path / "x.h5") == made
    assert made.digest


def test_digests_do_not_depend_on_the_order_of_sets(two_link_results, tmp_path):
    """The same samples written under two hash seeds have one digest."""
    digests = set()
    for seed in ("1", "2"):
        copy = tmp_path / seed
        shutil.copytree(two_link_results, copy)
        seeded = {**os.environ, "PYTHONHASHSEED": seed}
        subprocess.run([*SAMPLE, "--results", copy], env=seeded, check=True)
        digests.add(read_stamp(copy / "samples.h5").digest)
    assert len(digests) == 1


def test_large_arrays_are_written_some_rows_at_a_time(tmp_path, monkeypatch):
    """The digest is that of the whole, whatever order the array has in memory."""
    rows = np.asfortranarray(np.random.default_rng(0).normal(size=(5000, 3)))

    def written(name):
        def fill(writer):
            writer.write_dataset("rows", rows)
            writer.write_dataset("count", 5000)

        return write(tmp_path / name, STAMP, fill).digest

    whole = written("whole.h5")
    monkeypatch.setattr(hdf5, "_AT_ONCE", 10_000)
    assert written("parts.h5") == whole
    with h5py.File(tmp_path / "parts.h5") as file:
        np.testing.assert_array_equal(file["rows"], rows)
        assert file["rows"].attrs["checks"].size > 1


@given(
    rows=st.integers(0, 40_000),
    columns=st.sampled_from([None, 1, 3, 50]),
    cuts=st.lists(st.integers(0, 40_000), max_size=8),
    flipped=st.booleans(),
    data=st.data(),
)
@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_slices_are_those_of_the_array_and_a_flip_is_noticed(
    tmp_path, rows, columns, cuts, flipped, data
):
    """Whatever blocks rows are written and read in."""
    rows = rows // (columns or 1)
    values = np.random.default_rng(rows).normal(
        size=(rows,) if columns is None else (rows, columns)
    )
    cuts = sorted({0, rows, *(min(cut, rows) for cut in cuts)})

    def fill(writer):
        append = writer.start_rows("grown", columns)
        for start, stop in itertools.pairwise(cuts):
            append(values[start:stop])
        writer.write_dataset("whole", values)

    path = tmp_path / "rows.h5"
    write(path, STAMP, fill)
    if flipped and values.nbytes > 10_000:
        place = path.read_bytes().find(values.tobytes()[-8:])
        assert place > 0
        damaged = bytearray(path.read_bytes())
        damaged[place] ^= 1 << data.draw(st.integers(0, 7))
        path.write_bytes(damaged)
        with pytest.raises(ArtifactError, match="checksum"), open_reader(path) as reader:
            reader.verify()
        return
    with open_reader(path) as reader:
        reader.verify()
        for name in ("grown", "whole"):
            np.testing.assert_array_equal(reader.read_array(name), values)
            found = reader.open_rows(name)
            for start, stop in data.draw(st.permutations(list(itertools.pairwise(cuts)))):
                np.testing.assert_array_equal(found[start:stop:2], values[start:stop:2])
                found[start:stop][...] = 0  # a copy: what is kept for the next slice stays


def test_long_lists_of_text_are_checked(tmp_path):
    names = [f"a rather long name of a parameter {k}" for k in range(1000)]
    write(tmp_path / "t.h5", STAMP, lambda writer: writer.write_dataset("names", names))
    with open_reader(tmp_path / "t.h5") as reader:
        assert list(reader.read_texts("names")) == names
    damaged = (tmp_path / "t.h5").read_bytes().replace(b"parameter 777", b"parameter 778")
    (tmp_path / "t.h5").write_bytes(damaged)
    with pytest.raises(ArtifactError, match="checksum"), open_reader(tmp_path / "t.h5") as reader:
        reader.read_texts("names")
