"""docs/learning.md from an example to slopes and learned parameters: its commands and its two scripts."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "learning.md"


def test_the_page_leads_to_slopes_and_learned_parameters(invoke, tmp_path, monkeypatch):
    for package in ("jax", "torch"):
        pytest.importorskip(package, reason=f"{package} is not installed")
    monkeypatch.chdir(tmp_path)
    text = PAGE.read_text()
    commands = re.findall(r"^paramreduce (.*)$", text, re.MULTILINE)
    assert [line.split()[0] for line in commands] == ["init", "run", "export", "export"]
    for line in commands:
        invoke(*line.split())
    scripts = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    shown = [
        subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
        for script in scripts
    ]
    assert "(100000, 2) (100000, 2, 2)" in shown[0].stdout
    assert float(shown[1].stdout.split(":")[1]) < 1e-6
