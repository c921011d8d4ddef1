"""docs/observer.md: its program compiles without warnings, and its thresholds hold in the simulated plant."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "observer.md"


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a compiler")
def test_thresholds_from_the_model_error_hold_and_contacts_are_seen(invoke, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = PAGE.read_text()
    for name, source in re.findall(r"`([\w.]+)`[^`]*?```c\n(.*?)```", text, re.DOTALL):
        Path(name).write_text(source)
    for line in "".join(re.findall(r"```sh\n(.*?)```", text, re.DOTALL)).splitlines():
        program, *words = line.split()
        if program == "paramreduce":
            invoke(*words)
        else:
            words += ["-Wextra", "-Werror", "-pedantic"] * (program == "cc")
            done = subprocess.run([program, *words], capture_output=True, text=True, check=False)
            assert done.returncode == 0, done.stdout + done.stderr
    errors = [float(x) for x in re.findall(r"tracking error (\S+) mrad", done.stdout)]
    residuals = [float(x) for x in re.findall(r"without contact (\S+) N m", done.stdout)]
    assert len(residuals) == 4
    assert max(residuals[:2]) < 1e-4 < min(residuals[2:])  # the full model has the plant's torques
    assert errors[0] < errors[1]
    assert done.stdout.count("is seen after") == 2
