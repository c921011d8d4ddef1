import shutil
import subprocess
import sys

import pytest
from conftest import ROOT, TWO_LINK

from paramreduce_cli.running.workflow import format_make_rules, format_outline


def test_committed_rules_are_those_of_the_declared_stages():
    assert (ROOT / "pipelines" / "stages.mk").read_text() == format_make_rules()


def test_outline_names_every_stage():
    lines = format_outline().splitlines()
    assert lines[:2] == ["process-log: the config -> log.h5", "build-model: log.h5 -> model.h5"]
    assert len(lines) == 9


@pytest.fixture
def make(tmp_path):
    if shutil.which("make") is None:
        pytest.skip("make is not installed")
    (tmp_path / "configs").mkdir()
    shutil.copy(TWO_LINK, tmp_path / "configs" / "arm.yaml")
    (tmp_path / "stages.mk").write_text(format_make_rules())
    program = (
        tmp_path / "program"
    )  # which says what it is asked to do, and knows which files a run makes
    program.write_text(
        f'#!/bin/sh\n[ "$1" = stages ] && exec {sys.executable} -m paramreduce_cli "$@"\necho paramreduce "$@"\n'
    )
    program.chmod(0o755)

    def call(target, *settings):
        command = ["make", "-f", "stages.mk", f"PARAMREDUCE={program}", *settings, target]
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


@pytest.mark.parametrize(
    ("settings", "config", "made"),
    [
        ((), "", False),
        (("PARAMREDUCE_FLAGS=--jobs 1 --set terms.torque_error=0.01",), "", True),
        ((), "\nterms: {torque_error: 0.01}\n", True),
        ((), "\n'terms': {torque_error: 0.01}\n", True),
    ],
)
def test_make_asks_which_files_a_run_makes(make, tmp_path, settings, config, made):
    path = tmp_path / "configs" / "arm.yaml"
    path.write_text(path.read_text().replace("\nterms:", "\n# terms:") + config)
    assert ("reduce-terms" in make("results/arm/report/summary.json", *settings)) == made
