"""Lists of runs, and the commands that they stand for."""

import os
import shlex
import subprocess
from pathlib import Path

import h5py
import pytest
from conftest import CONFIGS, ONE_FORMAT, TWO_LINK

from paramreduce_cli.errors import ConfigError
from paramreduce_cli.pipeline import pipeline
from paramreduce_cli.records import Share
from paramreduce_cli.sweep import load_sweep
from paramreduce_cli.workflow import slurm_script

STAGES = {stage.name: stage for stage in pipeline()}


def listed(folder, text):
    path = folder / "sweep.yaml"
    path.write_text(text)
    return path


def test_every_robot_with_every_seed_and_every_variant(tmp_path):
    sweep = load_sweep(
        listed(
            tmp_path,
            f"robots: [{CONFIGS / 'two_link.yaml'}, {CONFIGS / 'four_bar.yaml'}]\n"
            "seeds: [3, 5]\n"
            "variants: {long: ['trajectories.points=200'], plain: []}\n"
            "parts: {reduce: 3}\n"
            "results: here\n",
        )
    )
    assert list(sweep.runs)[:4] == [
        "two_link-3-long", "two_link-3-plain", "two_link-5-long", "two_link-5-plain",
    ]  # fmt: skip
    assert len(sweep.runs) == 8
    run = sweep.runs["two_link-5-long"]
    assert run.config.trajectories.seed == 5
    assert run.config.trajectories.points == 200
    assert run.folder == tmp_path / "here" / "two_link-5-long"
    assert sweep.shares(STAGES["reduce"]) == [Share(1, 3), Share(2, 3), Share(3, 3)]
    assert sweep.shares(STAGES["sample"]) == []
    assert sweep.shares(STAGES["validate"]) == []


def test_commands_are_those_of_the_shell(tmp_path):
    config = CONFIGS / "two_link.yaml"
    sweep = load_sweep(listed(tmp_path, f"robots: [{config}]\nresults: r\n"))
    (run,) = sweep.runs.values()
    text = run.command(STAGES["reduce"], Share(2, 3), jobs="4")
    words = shlex.split(text)
    assert words[2:4] == ["paramreduce_cli", "reduce"]
    assert words[-3:] == ["--quiet", "--jobs", "4"]
    assert words[-5:-3] == ["--part", "2/3"]
    assert run.command(STAGES["validate"]).endswith("|| [ $? -eq 1 ]")
    for stage in run.stages:
        assert Path(run.needs(stage)[0]).resolve() == config
    needed = [name.rpartition("/")[2] for name in run.needs(STAGES["report"])]
    assert needed == ["two_link.yaml", "model.h5", "trajectories.h5", "samples.h5", "reduction.h5",
                      "validation.h5"]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("robots: []", "robots"),
        ("seeds: [1]", "robots"),
        ("robots: [a.yaml]\nseed: [1]", "did you mean seeds"),
        ("robots: [a.yaml]\nparts: {reduce: 0}", "parts.reduce"),
        ("robots: [a.yaml, b/a.yaml]", "two runs are called a"),
        ("- a.yaml", "must be a mapping"),
    ],
)
def test_lists_that_cannot_be(tmp_path, text, says):
    with pytest.raises(ConfigError, match=says):
        load_sweep(listed(tmp_path, text))


_SBATCH = """#!/usr/bin/env bash
echo "$@" >> {folder}/calls
for word; do
  case "$word" in
    --array=1-*) count=${{word#--array=1-}};;
    --wrap) ;;
    *) command="$word";;
  esac
done
for task in $(seq "$count"); do SLURM_ARRAY_TASK_ID=$task bash -c "$command"; done
wc -l < {folder}/calls
"""
"""Does what it is given at once, and counts."""


def scheduled(folder, text):
    """Run a script with this sbatch; returns the calls of it."""
    (folder / "bin").mkdir(exist_ok=True)
    sbatch = folder / "bin" / "sbatch"
    sbatch.write_text(_SBATCH.format(folder=folder))
    sbatch.chmod(0o755)
    (folder / "sweep.sh").write_text(text)
    environment = {**os.environ, "PATH": f"{folder / 'bin'}:{os.environ['PATH']}"}
    subprocess.run(
        ["bash", folder / "sweep.sh"], check=True, env=environment, stdout=subprocess.DEVNULL
    )
    return (folder / "calls").read_text().splitlines()


def test_a_script_for_slurm_makes_what_a_plain_run_makes(tmp_path, two_link_results, invoke):
    path = listed(
        tmp_path, f"robots: [{TWO_LINK}]\nvariants: {{a: ['{ONE_FORMAT}']}}\nresults: r\n"
        "parts: {optimize-trajectories: 2, reduce: 3}\n",
    )  # fmt: skip
    text = invoke("graph", "--format", "slurm", "--sweep", path).out
    calls = scheduled(tmp_path, text)
    assert len(calls) == 5
    assert ["--dependency" in call for call in calls] == [False, True, True, True, True]
    folder = tmp_path / "r" / "two_link-a"
    for name in ("trajectories.h5", "samples.h5", "reduction.h5", "validation.h5"):
        with h5py.File(folder / name) as one, h5py.File(two_link_results / name) as other:
            assert one.attrs["digest"] == other.attrs["digest"]
    before = {path: path.read_bytes() for path in folder.glob("*.h5")}
    scheduled(tmp_path, text)
    assert {path: path.read_bytes() for path in folder.glob("*.h5")} == before
    assert not list(folder.glob("*.parts"))


def test_a_thousand_parts_take_few_calls(tmp_path):
    """Calls of the scheduler grow with the stages that are done as several jobs alone."""
    sweep = load_sweep(
        listed(
            tmp_path, f"robots: [{TWO_LINK}]\nseeds: [0, 1, 2, 3]\nresults: r\n"
            "parts: {optimize-trajectories: 250, sample: 250, reduce: 250}\n",
        )
    )  # fmt: skip
    text = slurm_script(sweep)
    assert text.count("\nsubmit ") == 7
    assert [len(phase) for phase in sweep.phases()] == [4, 1000, 4, 1000, 4, 1000, 4]
