"""docs/vehicles.md from hardpoints to lean code: its commands, on its example with short motions."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "vehicles.md"
SHORT = ["sampling.simulation.duration=0.5", "sampling.simulation.runs=1", "sampling.simulation.test_runs=1",
         "reduction.heuristics=[swap]", "validation.accept={}", "report.formats=[svg]"]  # fmt: skip


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs a compiler")
def test_the_page_leads_from_hardpoints_to_code_that_runs(invoke, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    commands = re.findall(r"^paramreduce (.*)$", PAGE.read_text(), re.MULTILINE)
    assert [line.split()[0] for line in commands] == ["init", "run", "export"]
    for line in commands:
        words = line.split()
        invoke(*words, settings=[] if words[0] == "init" else SHORT)
    summary = json.loads((tmp_path / "results/wishbone/report/summary.json").read_text())
    assert summary["selected"]["n"] < summary["model"]["n_base"]
    assert summary["manoeuvre"]["position_error"] < 0.05
    (code,) = tmp_path.glob("**/wishbone.c")
    subprocess.run(["make", "-C", str(code.parent), "test"], check=True, capture_output=True)
    assert "wishbone_states" in code.read_text()
