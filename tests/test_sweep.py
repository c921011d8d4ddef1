"""Lists of runs, and the commands that they stand for."""

import re
import shlex
from pathlib import Path

import pytest
from cluster.scripted import scheduled
from conftest import CONFIGS, TWO_LINK
from simulated_logs import log_config

from paramreduce_cli.errors import ConfigError
from paramreduce_cli.records import Part
from paramreduce_cli.running import workflow
from paramreduce_cli.running.pipeline import list_stages
from paramreduce_cli.running.sweep import Sweep, SweepRun, load_sweep
from paramreduce_cli.running.workflow import format_slurm_script

STAGES = {stage.name: stage for stage in list_stages()}


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
    assert (run.seed, run.variant) == (5, "long")
    assert sweep.list_parts(STAGES["reduce"], run) == [Part(1, 3), Part(2, 3), Part(3, 3)]
    assert sweep.list_parts(STAGES["sample"], run) == []
    assert sweep.list_parts(STAGES["validate"], run) == []


def test_what_a_run_has_nothing_of_to_do_in_parts_is_one_job(tmp_path):
    text = (
        f"robots: [{CONFIGS / 'two_link.yaml'}]\nparts: {{reduce: 2, sample: 2}}\nresults: r\n"
        "variants: {all: [], heuristic: ['reduction.heuristics=[swap]', selected.heuristic=swap]}\n"
    )
    sweep = load_sweep(listed(tmp_path, text))
    proven, swapped = sweep.runs.values()
    assert len(sweep.list_parts(STAGES["reduce"], proven)) == 2
    assert sweep.list_parts(STAGES["reduce"], swapped) == []
    assert (
        sum(
            " reduce " in line and "--part" in line
            for lines in sweep.list_phases("1")
            for line in lines
        )
        == 2
    )
    log_config(tmp_path)
    logged = load_sweep(listed(tmp_path, "robots: [arm.yaml]\nparts: {sample: 2}\n"))
    assert logged.list_parts(STAGES["sample"], logged.runs["arm"]) == []


def test_commands_are_those_of_the_shell(tmp_path):
    config = CONFIGS / "two_link.yaml"
    sweep = load_sweep(listed(tmp_path, f"robots: [{config}]\nresults: r\n"))
    (run,) = sweep.runs.values()
    text = run.format_command(STAGES["reduce"], Part(2, 3), jobs="4")
    words = shlex.split(text)
    assert words[2:4] == ["paramreduce_cli", "reduce"]
    assert words[-4:] == ["--quiet", "--wait", "--jobs", "4"]
    assert words[-6:-4] == ["--part", "2/3"]
    assert run.format_command(STAGES["validate"]).endswith("|| [ $? -eq 1 ]")
    for stage in run.stages:
        assert Path(run.list_required_files(stage)[0]).resolve() == config
    needed = [name.rpartition("/")[2] for name in run.list_required_files(STAGES["report"])]
    assert needed == ["two_link.yaml", "model.h5", "trajectories.h5", "samples.h5", "reduction.h5",
                      "validation.h5"]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("robots: []", "robots"),
        ("seeds: [1]", "robots"),
        ("robots: [a.yaml]\nseed: [1]", "Did you mean seeds"),
        ("robots: [a.yaml]\nparts: {reduce: 0}", "parts.reduce"),
        ("robots: [a.yaml, b/a.yaml]", "two runs are called a"),
        ("- a.yaml", "must be a mapping"),
        ("robots: [a.yaml]\nparts: {reduced: 2}", "parts.*Did you mean reduce"),
        ("robots: [a.yaml]\nseeds: [1, 2, 1]", "the seed 1 is listed twice"),
        ("robots: [a.yaml]\nvariants: {a/b: []}", "'a/b' becomes part of a folder's"),
        ("robots: [missing.yaml]", r"sweep.yaml: robots: .*missing.yaml.*no such file"),
        (
            f"robots: [{TWO_LINK}]\nvariants: {{long: [trajectories.pints=3]}}",
            r"sweep.yaml: variants.long: --set .*Did you mean points",
        ),
    ],
)
def test_lists_that_cannot_be(tmp_path, text, says):
    with pytest.raises(ConfigError, match=says):
        load_sweep(listed(tmp_path, text))


def test_a_script_for_slurm_submits_phases_that_wait_for_each_other(tmp_path):
    path = listed(tmp_path, f"robots: [{TWO_LINK}]\nresults: r\nparts: {{sample: 2, reduce: 3}}\n")
    calls = scheduled(tmp_path, format_slurm_script(load_sweep(path)), run=False)
    assert ["--dependency=afterany:" in call for call in calls] == [
        False,
        True,
        True,
        True,
        True,
        True,
    ]
    assert ["--array=1-2" in call for call in calls] == [False, True, False, False, False, False]
    assert all("--requeue" in call for call in calls)
    (commands,) = (tmp_path / "r" / ".slurm").glob("*/paramreduce-4.commands")
    lines = commands.read_text().splitlines()
    assert [line.split()[-5] for line in lines] == ["1/3", "2/3", "3/3"]


def test_more_commands_than_an_array_may_have_tasks_are_dealt_to_them(tmp_path, monkeypatch):
    monkeypatch.setattr(workflow, "_MOST_TASKS", 2)
    monkeypatch.setattr(
        Sweep,
        "list_phases",
        lambda *_: [[f"echo {k} >> done" if k != 1 else "false" for k in range(5)]],
    )
    monkeypatch.chdir(tmp_path)
    path = listed(tmp_path, f"robots: [{TWO_LINK}]\nresults: r s\n")
    calls = scheduled(tmp_path, format_slurm_script(load_sweep(path)))
    assert ["--array=1-2" in call for call in calls] == [True]
    assert (tmp_path / "done").read_text().split() == ["0", "2", "4", "3"]


def test_a_thousand_parts_take_few_calls(tmp_path):
    """Calls of the scheduler grow with the stages that are done as several jobs alone."""
    sweep = load_sweep(
        listed(
            tmp_path, f"robots: [{TWO_LINK}]\nseeds: [0, 1, 2, 3]\nresults: r\n"
            "parts: {optimize-trajectories: 250, sample: 250, reduce: 250}\n",
        )
    )  # fmt: skip
    text = format_slurm_script(sweep)
    assert text.count("\nsubmit ") == 8
    assert [len(phase) for phase in sweep.list_phases("1")] == [4, 1000, 4, 1000, 4, 1000, 4, 1]


def test_the_snakefile_calls_methods_that_exist():
    """Ordinary tests do not run Snakemake, and renames do not reach its file."""
    text = (CONFIGS.parent / "pipelines" / "Snakefile").read_text()
    called = {
        SweepRun: set(re.findall(r"sweep\.runs\[w\.run\]\.(\w+)\(", text)),
        Sweep: set(re.findall(r"\bsweep\.(\w+)\(", text)),
    }
    for kind, names in called.items():
        assert names
        assert names <= set(dir(kind))
