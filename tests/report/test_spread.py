"""Many runs beside each other."""

import copy
import csv

import pytest

from paramreduce_cli.report.spread import choices, run_record, spread


def changed(summary, **selected):
    """The summary of another run of the same robot."""
    other = copy.deepcopy(summary)
    other["selected"] |= selected
    return other


def test_medians_and_extremes_over_the_runs_of_a_robot(summary):
    records = [
        run_record(str(n), changed(summary, n=n, operations={"inverse": 10 * n, "direct": None}))
        for n in (3, 5, 4)
    ]
    records.append(run_record("x", {**summary, "robot": "other"}))
    table = spread(records)
    assert [row[:2] for row in table.rows] == [("two_link", "3"), ("other", "1")]
    row = dict(zip(table.header, table.rows[0], strict=True))
    assert row["n"] == "4 (3 to 5)"
    assert row["d"] == "40 (30 to 50)"
    assert row["M, δ"] == "-"
    assert row["accepted"] == "3 of 3"


def test_what_is_always_selected(summary):
    records = [
        run_record(str(k), changed(summary, parameters=dict.fromkeys(names, 1.0)))
        for k, names in enumerate([("a", "b"), ("a", "c"), ("a", "b")])
    ]
    (row,) = choices(records).rows
    assert row == ("two_link", "a", "b 2/3 c 1/3")


def test_the_command_on_many_runs(invoke, summary, two_link_results, two_link_copy, tmp_path):
    """A page, and a row of numbers for every run."""
    pyarrow = pytest.importorskip("pyarrow.parquet")
    runs = (two_link_results, two_link_copy)
    out = invoke("table", *runs, "--output", tmp_path / "all", "--parquet").out
    assert "Spread over runs" in out
    page = (tmp_path / "all.html").read_text()
    assert "2 runs of two_link" in page
    assert "What is selected" in page
    assert "http" not in page
    rows = list(csv.DictReader((tmp_path / "all-runs.csv").open()))
    assert [row["run"] for row in rows] == [path.name for path in runs]
    read = pyarrow.read_table(tmp_path / "all-runs.parquet").to_pylist()
    assert [row["n"] for row in read] == [summary["selected"]["n"]] * 2
    expected = summary["selected"]["torque_error"]["validation"]
    assert read[0]["torque_error_validation"] == expected
    assert float(rows[0]["torque_error_validation"]) == expected
