"""Finished items in files, which several jobs read and write."""

import dataclasses

import numpy as np
import pytest

from paramreduce_cli.artifacts.hdf5 import SCHEMA, Stamp
from paramreduce_cli.artifacts.stored_items import StoredItems

STAMP = Stamp(
    SCHEMA,
    "arm",
    "reduce",
    dict.fromkeys(("paramreduce", "numpy", "scipy", "casadi"), "1"),
    {},
    {},
    0,
    0.0,
)


def stored(folder, stamp=STAMP):
    return StoredItems(folder / "reduction.h5", lambda seconds: stamp)


@pytest.fixture
def items(tmp_path):
    found = stored(tmp_path)
    found["incumbent-0007"] = np.array([3, 1, 2])
    return found


def test_what_one_job_writes_all_read(items, tmp_path):
    other = stored(tmp_path)
    assert other["incumbent-0007"].tolist() == [3, 1, 2]
    items["incumbent-0007"] = np.array([4, 5])
    items["n-0012"] = np.array([6])
    assert other["incumbent-0007"].tolist() == [4, 5]
    assert list(other) == ["incumbent-0007", "n-0012"]
    del items["incumbent-0007"]
    assert "incumbent-0007" not in other
    assert len(other) == 1


def test_what_is_damaged_or_of_another_config_is_not_read(items, tmp_path):
    other = dataclasses.replace(STAMP, sections={"reduction": "other"})
    key = "incumbent-0007"
    assert key not in stored(tmp_path, other)
    (path,) = (tmp_path / "reduction.h5.items").glob("incumbent-*")
    content = path.read_bytes()
    for k in range(0, len(content), 97):
        path.write_bytes(content[:k] + bytes([content[k] ^ 1]) + content[k + 1 :])
        assert key not in (fresh := stored(tmp_path)) or fresh[key].tolist() == [3, 1, 2]
    path.write_bytes(content[:100])
    assert key not in stored(tmp_path)


def test_what_a_swallowed_interruption_may_have_spoilt_is_not_kept(tmp_path):
    def check():
        raise KeyboardInterrupt

    items = StoredItems(tmp_path / "x.h5", lambda seconds: STAMP, check=check)
    with pytest.raises(KeyboardInterrupt):
        items["a"] = np.arange(3)
    assert list(items) == []
