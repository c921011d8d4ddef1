import shutil
import subprocess

import pytest
from conftest import ROOT, TWO_LINK

from paramreduce_cli.workflow import make_rules, outline


def test_committed_rules_are_those_of_the_declared_stages():
    assert (ROOT / "pipelines" / "stages.mk").read_text() == make_rules()


def test_outline_names_every_stage():
    lines = outline().splitlines()
    assert lines[0] == "build-model: the config -> model.h5"
    assert len(lines) == 9


@pytest.fixture
def make(tmp_path):
    if shutil.which("make") is None:
        pytest.skip("make is not installed")
    (tmp_path / "configs").mkdir()
    shutil.copy(TWO_LINK, tmp_path / "configs" / "arm.yaml")
    (tmp_path / "stages.mk").write_text(make_rules())

    def call(target):
        command = ["make", "-f", "stages.mk", "PARAMREDUCE=echo paramreduce", target]
        lines = subprocess.check_output(command, cwd=tmp_path, text=True).splitlines()
        return [line.split()[1] for line in lines if line.startswith("paramreduce")]

    return call


def test_make_does_just_what_is_missing_for_a_target(make, tmp_path):
    stages = ["build-model", "optimize-trajectories", "sample", "reduce"]
    assert make("results/arm/reduction.h5") == stages
    folder = tmp_path / "results" / "arm"
    folder.mkdir(parents=True)
    for name in ("model.h5", "trajectories.h5"):
        (folder / name).touch()
    assert make("results/arm/reduction.h5") == stages[2:]
