"""Many runs beside each other."""

import copy
import csv
import shutil

import pytest
from conftest import TWO_LINK

from paramreduce_cli.report.spread import make_run_record, tabulate_choices, tabulate_spread


def changed(summary, **selected):
    """The summary of another run of the same robot."""
    other = copy.deepcopy(summary)
    other["selected"] |= selected
    return other


def test_medians_and_extremes_over_the_runs_of_a_robot(summary):
    records = [
        make_run_record(
            str(n), changed(summary, n=n, operations={"inverse": 10 * n, "direct": None})
        )
        for n in (3, 5, 4)
    ]
    records.append(make_run_record("x", {**summary, "robot": "other"}))
    table = tabulate_spread(records)
    assert [row[:2] for row in table.rows] == [("two_link", "3"), ("other", "1")]
    row = dict(zip(table.header, table.rows[0], strict=True))
    assert row["n"] == "4 (3 to 5)"
    assert row["operations inverse"] == "40 (30 to 50)"
    assert row["operations direct"] == "-"
    assert row["accepted"] == "3 of 3"


def test_what_is_always_selected(summary):
    records = [
        make_run_record(str(k), changed(summary, parameters=dict.fromkeys(names, 1.0)))
        for k, names in enumerate([("a", "b"), ("a", "c"), ("a", "b")])
    ]
    (row,) = tabulate_choices(records).rows
    assert row == ("two_link", "a", "b 2/3 c 1/3")


def test_variants_of_a_robot_are_apart(summary):
    records = [
        make_run_record(str(n), changed(summary, n=n), variant, seed=n)
        for n, variant in ((3, "plain"), (5, "plain"), (9, "fine"))
    ]
    table = tabulate_spread(records)
    assert [row[0] for row in table.rows] == ["two_link, plain", "two_link, fine"]
    assert [row[table.header.index("n")] for row in table.rows] == ["4 (3 to 5)", "9"]


def test_the_command_on_a_sweep_leaves_out_and_names_what_has_not_ended(
    invoke, two_link_results, tmp_path
):
    listed = tmp_path / "sweep.yaml"
    listed.write_text(
        f"robots: [{TWO_LINK}]\nseeds: [0, 1, 2]\nvariants: {{plain: []}}\nresults: here\n"
    )
    assert "none of its 3 runs is finished" in invoke("table", "--sweep", listed, code=2).err
    for seed in (0, 2):
        shutil.copytree(two_link_results, tmp_path / "here" / f"two_link-{seed}-plain")
    said = invoke("table", "--sweep", listed)
    assert "unfinished runs are left out: two_link-1-plain" in said.err
    assert "two_link, plain" in said.out
    rows = list(csv.DictReader((tmp_path / "here" / "table-runs.csv").open()))
    assert [(row["variant"], row["seed"]) for row in rows] == [("plain", "0"), ("plain", "2")]
    for part in ("", "-spread", "-choices"):
        (header, *rest) = csv.reader((tmp_path / "here" / f"table{part}.csv").open())
        assert rest
        assert {len(row) for row in rest} == {len(header)}
    assert "Give RESULTS, or --sweep FILE" in invoke("table", code=2).err


def test_the_command_on_many_runs(invoke, summary, two_link_results, two_link_copy, tmp_path):
    """A page, and a row of numbers for every run."""
    pyarrow = pytest.importorskip("pyarrow.parquet")
    runs = (two_link_results, two_link_copy)
    out = invoke("table", *runs, "--output", tmp_path / "all", "--parquet").out
    assert "Spread over runs" in out
    page = (tmp_path / "all.html").read_text()
    assert "2 runs of two_link" in page
    assert "What is selected" in page
    assert "data:image/svg+xml;base64," in page
    assert "http" not in page
    rows = list(csv.DictReader((tmp_path / "all-runs.csv").open()))
    assert [row["run"] for row in rows] == [path.name for path in runs]
    read = pyarrow.read_table(tmp_path / "all-runs.parquet").to_pylist()
    assert [row["n"] for row in read] == [summary["selected"]["n"]] * 2
    expected = summary["selected"]["torque_error"]["validation"]
    assert read[0]["torque_error_validation"] == expected
    assert float(rows[0]["torque_error_validation"]) == expected
