import csv
import io

from paramreduce_cli.report.overview import make_overview, make_overview_row
from paramreduce_cli.texts.latex_table import format_latex_table


def test_one_row_per_robot_with_the_selected_model(summary):
    other = {**summary, "robot": "other"}
    table = make_overview([make_overview_row(summary), make_overview_row(other)])
    assert [row[0] for row in table.rows] == ["two_link", "other"]
    row = dict(zip(table.header[:7], table.rows[0][:7], strict=True))
    selected = summary["selected"]
    assert row["heuristic"] == selected["heuristic"]
    assert int(row["n"]) == selected["n"]
    assert int(row["operations inverse, full"]) == summary["full"]["operations_inverse"]
    assert int(row["operations inverse"]) == selected["operations"]["inverse"]
    rows = list(csv.reader(io.StringIO(table.to_csv())))
    assert {len(row) for row in rows} == {17}
    assert format_latex_table(table).count("&") == 3 * 16
    assert "two_link" in table.to_text()


def test_the_command_writes_text_csv_and_latex(invoke, two_link_results, tmp_path):
    out = invoke("table", two_link_results, "--output", tmp_path / "all").out
    assert "two_link" in out
    assert (tmp_path / "all.txt").read_text() in out
    assert (tmp_path / "all.csv").read_text().startswith("robot,heuristic")
    assert r"\begin{tabular}" in (tmp_path / "all.tex").read_text()


def test_folders_without_a_report(invoke, tmp_path):
    assert (
        "holds no results itself. Run `paramreduce run CONFIG`"
        in invoke("table", tmp_path, code=2).err
    )
    assert not (tmp_path / "table.csv").exists()


def test_a_summary_of_another_version(invoke, tmp_path):
    (tmp_path / "old.json").write_text('{"robot": "old"}')
    refused = invoke("table", tmp_path / "old.json", "--output", tmp_path / "all", code=2)
    assert "is not a summary of this version" in refused.err
