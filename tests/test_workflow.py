import shutil
import subprocess

import pytest
from conftest import CONFIGS, ROOT

from paramreduce_cli.workflow import make_rules, outline


def test_committed_rules_are_those_of_the_declared_stages():
    assert (ROOT / "pipelines" / "stages.mk").read_text() == make_rules()


def test_outline_names_every_stage():
    lines = outline().splitlines()
    assert lines[0] == "build-model: the config -> model.h5"
    assert len(lines) == 6


@pytest.fixture
def make(tmp_path):
    if shutil.which("make") is None:
        pytest.skip("make is not installed")
    (tmp_path / "configs").mkdir()
    shutil.copy(CONFIGS / "two_link.yaml", tmp_path / "configs" / "arm.yaml")
    (tmp_path / "stages.mk").write_text(make_rules())

    def call(target, *flags):
        done = subprocess.run(
            ["make", "-f", "stages.mk", "PARAMREDUCE=echo paramreduce", *flags, target],
            cwd=tmp_path, capture_output=True, text=True, check=True,
        )  # fmt: skip
        return [
            line.split()[1] for line in done.stdout.splitlines() if line.startswith("paramreduce")
        ]

    return call


def test_make_does_just_what_is_missing_for_a_target(make, tmp_path):
    assert make("results/arm/reduction.h5") == [
        "build-model",
        "optimize-trajectories",
        "sample",
        "reduce",
    ]
    folder = tmp_path / "results" / "arm"
    folder.mkdir(parents=True)
    for name in ("model.h5", "trajectories.h5"):
        (folder / name).touch()
    assert make("results/arm/reduction.h5") == ["sample", "reduce"]
