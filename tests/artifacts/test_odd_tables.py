"""Tables as spreadsheets and loggers write them."""

import gzip

import numpy as np
import pytest

from paramreduce_cli.artifacts.log_files import load_log

HEADER, ROWS = ["t", "q1", "tau1"], [[0.0, 1.5, -2.0], [0.1, 1.25, 3.0], [0.2, -1.0, 4.5]]


def text(delimiter=",", end="\n", quote="", header=HEADER):
    rows = [[f"{quote}{name}{quote}" for name in header], *ROWS]
    return end.join(delimiter.join(map(str, row)) for row in rows) + end


@pytest.mark.parametrize(
    "content",
    [
        text().encode("utf-16"),
        text("\t").encode("utf-16"),
        b"\xfe\xff" + text().encode("utf-16-be"),
        text().encode("utf-8-sig"),
        text(quote='"').encode(),
        text(quote='"""').encode(),
        text(end="\r\n").encode(),
        text(end="\r").encode(),
        text(";").encode(),
    ],
    ids=["utf-16", "utf-16 tabs", "big-endian", "mark", "quotes", "quotes twice", "crlf", "cr", "semicolons"],
)  # fmt: skip
@pytest.mark.parametrize("zipped", [False, True])
def test_tables_are_read_whatever_wrote_them(tmp_path, content, zipped):
    path = tmp_path / ("log.csv.gz" if zipped else "log.csv")
    path.write_bytes(gzip.compress(content) if zipped else content)
    log = load_log(path)
    assert list(log.columns) == HEADER
    np.testing.assert_array_equal(np.column_stack(list(log.columns.values())), ROWS)
    assert not log.others


def test_columns_of_text_are_told_by_name(tmp_path, invoke):
    path, robot = tmp_path / "log.csv", tmp_path / "arm.urdf"
    rows = "".join(f"2026-11-28 10:00:0{k},0.{k},1,ok\n" for k in range(5))
    path.write_text("t,q1,tau1,state\n" + rows)
    assert load_log(path).others == {"t": "text", "state": "text"}
    robot.write_text(
        '<robot name="a"><link name="b"/><link name="c"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" '
        'iyy="1" iyz="0" izz="1"/></inertial></link><joint name="j" type="continuous"><parent link="b"/><child link="c"/>'
        '<axis xyz="0 0 1"/></joint></robot>'
    )
    said = invoke("init", robot, "--log", path, "--output", tmp_path / "c.yaml").out
    assert "- t: holds text." in said
    assert "recorded_rate: TODO" in (tmp_path / "c.yaml").read_text()
    path.write_text("t,q1,tau1\n")
    said = invoke("init", robot, "--log", path, "--output", tmp_path / "d.yaml", code=2).err
    assert "has headings, but no rows of numbers below" in " ".join(said.split())
