"""Matrices in files against those in memory."""

import os
import sys

import numpy as np
import pytest

from paramreduce_cli.resources.scratch import LargeTable, allocate_matrix, stack_columns, stack_rows

SCRATCH = sys.modules["paramreduce_cli.resources.scratch"]


@pytest.fixture(params=["in memory", "in a file", "no room"])
def place(request, monkeypatch, tmp_path):
    """Where matrices are; files vanish by themselves."""
    if request.param != "in memory":
        monkeypatch.setattr(SCRATCH, "_LARGE", 1)
        monkeypatch.setattr(SCRATCH, "_WAITING", 7)
        monkeypatch.setenv("TMPDIR", str(tmp_path))
        monkeypatch.setattr("tempfile.tempdir", None)
    if request.param == "no room":

        def full(*_):
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(os, "posix_fallocate", full)
    yield request.param
    assert list(tmp_path.iterdir()) == []


def test_a_matrix_has_columns_without_gaps_and_can_be_written(place):
    found = allocate_matrix(5, 3)
    assert found.shape == (5, 3)
    assert found.T.flags.c_contiguous
    assert type(found) is np.ndarray
    assert ("mmap" in repr(type(found.base.base))) == (place == "in a file")
    found[:] = np.arange(15.0).reshape(5, 3)
    np.testing.assert_array_equal(found[3], [9, 10, 11])


def test_columns_and_parts_are_joined(place):
    rows = np.arange(20.0).reshape(10, 2)
    np.testing.assert_array_equal(stack_columns(list(rows.T)), rows)
    np.testing.assert_array_equal(stack_rows([rows[:4], rows[4:5], rows[5:]]), rows)
    assert stack_rows([rows]) is rows


@pytest.mark.parametrize("n_rows", [0, 1, 4, 50])
def test_a_table_of_unknown_length(place, n_rows):
    rows = np.random.default_rng(0).normal(size=(n_rows, 3))
    with LargeTable() as table:
        for row in rows:
            table.extend(row.tolist())
        assert bool(table) == (n_rows > 0)
        found = table.to_matrix(3)
    np.testing.assert_array_equal(found, rows)
