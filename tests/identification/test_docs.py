"""The way that docs/logs.md describes, from a robot's recording to code, run as it stands."""

import gzip
import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from conftest import ONE_FORMAT, ROOT

from paramreduce_cli.config import load_config
from paramreduce_cli.robots.inertia import compute_pseudo_inertia, is_positive_semidefinite

QUICK = [
    ONE_FORMAT,
    "reduction.heuristics=[forward-selection]",
    "selected.heuristic=forward-selection",
    "validation.stability=false",
    "reduction.stop.parameters=24",
]


def test_the_commands_of_the_docs_on_a_real_recording(tmp_path, monkeypatch, invoke):
    pytest.importorskip("cvxpy")
    monkeypatch.chdir(tmp_path)
    logs = ROOT / "configs" / "logs"
    urdf = (logs / "ur10.urdf").read_text()
    Path("robot.urdf").write_text(urdf.replace('<robot name="ur10">', '<robot name="robot">'))
    Path("recording.csv").write_bytes(gzip.decompress((logs / "ur10.csv.gz").read_bytes()))
    text = (ROOT / "docs" / "logs.md").read_text()
    block = re.search(r"```\n(paramreduce .*?)```", text, re.DOTALL)[1]
    commands = [line.split("#")[0] for line in block.strip().split("\n")]
    names = ["init", "check-data", "run", "export", "export"]
    assert [shlex.split(command)[1] for command in commands] == names
    for command in commands:
        _, name, *arguments = shlex.split(command)
        invoke(name, *arguments, settings=() if name in ("init", "check-data") else QUICK)
    found = json.loads(Path("results/robot/report/summary.json").read_text())["identification"]
    assert found["full"]["held_out"] < 0.079
    assert found["reduced"]["held_out"] < found["full"]["held_out"]
    assert found["reduced"]["n"] <= 20
    assert found["consistent"]["bodies_positive"]
    assert found["consistent"]["held_out"] < 1.1 * found["full"]["held_out"]
    assert Path("results/robot/export/c/robot.h").exists()
    invoke("init", "results/robot/export/urdf/robot.urdf", "--output", "again.yaml")
    bodies = load_config(Path("again.yaml")).get_body_parameters()
    assert len(bodies) == 6
    for body in bodies.values():
        assert is_positive_semidefinite(compute_pseudo_inertia(body.get_values()))
        assert np.isfinite(list(body.get_values().values())).all()
