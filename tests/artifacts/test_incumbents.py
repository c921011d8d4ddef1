"""What jobs tell each other through files."""

import dataclasses

import numpy as np
import pytest

from paramreduce_cli.artifacts.hdf5 import SCHEMA, Stamp
from paramreduce_cli.artifacts.incumbents import StoredIncumbents

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


@pytest.fixture
def told(tmp_path):
    found = StoredIncumbents(tmp_path / "parts", STAMP)
    found[7] = np.array([3, 1, 2])
    return found


def test_what_one_job_tells_all_hear(told, tmp_path):
    other = StoredIncumbents(tmp_path / "parts", STAMP)
    assert other[7].tolist() == [3, 1, 2]
    told[7] = np.array([4, 5])
    told[12] = np.array([6])
    assert other[7].tolist() == [4, 5]
    assert list(other) == [7, 12]
    del told[7]
    assert 7 not in other
    assert len(other) == 1


def test_what_is_damaged_or_of_another_config_is_not_heard(told, tmp_path):
    sections = {"reduction": "other"}
    assert 7 not in StoredIncumbents(
        tmp_path / "parts", dataclasses.replace(STAMP, sections=sections)
    )
    (path,) = (tmp_path / "parts").glob(".incumbent-*")
    content = path.read_bytes()
    for k in range(0, len(content), 97):
        path.write_bytes(content[:k] + bytes([content[k] ^ 1]) + content[k + 1 :])
        assert 7 not in (fresh := StoredIncumbents(tmp_path / "parts", STAMP)) or fresh[
            7
        ].tolist() == [3, 1, 2]
    path.write_bytes(content[:100])
    assert 7 not in StoredIncumbents(tmp_path / "parts", STAMP)
