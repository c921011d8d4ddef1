"""What people type first, and what they are told to type next."""

import json
import re
import shutil
import sys
from pathlib import Path

import h5py
import pytest
from conftest import CONFIGS, ONE_FORMAT

from paramreduce_cli.artifacts.hdf5 import SCHEMA

MOVES = [
    (["rnu", "configs/two_link.yaml"], "Did you mean `paramreduce run`"),
    (["Run", "configs/two_link.yaml"], "Did you mean `paramreduce run`"),
    (["build_model", "configs/two_link.yaml"], "Did you mean `paramreduce build-model`"),
    (["optimise-trajectories", "x.yaml"], "Did you mean `paramreduce optimize-trajectories`"),
    (["help"], "see `paramreduce --help`"),
    (["-v"], "paramreduce --help lists all commands"),
    (["run"], "Next: paramreduce run configs/two_link.yaml"),
    (["run", "two_link"], "Next: paramreduce run configs/two_link.yaml"),
    (["two_link"], "Next: paramreduce run configs/two_link.yaml"),
    (["configs/two_link.yaml"], "Next: paramreduce run configs/two_link.yaml"),
    (["run", "two_lnik"], "Next: paramreduce run configs/two_link.yaml"),
    (["run", "done/model.h5"], "Example: paramreduce run configs/two_link.yaml"),
    (["run", "configs/puma560.yaml"], "Next: paramreduce init --example puma560"),
    (["run", "two_link.yaml"], "Next: paramreduce run configs/two_link.yaml"),
    (["run", "configs/two_lnik.yaml"], "Did you mean configs/two_link.yaml?"),
    (["run", "configs"], "Example: paramreduce run configs/two_link.yaml"),
    (["run", "notes.txt"], "`paramreduce init --dh NAME` writes one"),
    (["run", "one.urdf"], "`paramreduce init one.urdf` makes a config of it"),
    (["run", "my_arm.urdf"], "`paramreduce init --dh my_arm` writes one"),
    (["run", "configs/empty.yaml"], "`paramreduce init --dh NAME` writes a whole config"),
    (["run", "configs/nothing.yaml"], "`paramreduce init --dh NAME` writes one"),
    (["run", "configs/broken.yaml"], "Then again: paramreduce run configs/broken.yaml"),
    (["run", "configs/two_link.yaml", "--sett", "a=b"],
     "Next: paramreduce run configs/two_link.yaml --set a=b"),
    (["init", "one.urdf", "-o", "one.yaml"], "Next: paramreduce init one.urdf -o one.yaml"),
    (["init", "--from", "one.urdf"], "Example: paramreduce init robot.urdf"),
    (["run", "configs/two_link.yaml", "--sett=selected.n=3"],
     "Next: paramreduce run configs/two_link.yaml --set=selected.n=3"),
    (["report", "--config", "configs/two_link.yaml"], "Example: paramreduce report"),
    (["run", "configs/two_link.yaml", "--set", "selected.m=4"], "Choose from: heuristic, n,"),
    (["run", "configs/two_link.yaml", "--set", "selected.n"], "write KEY=VALUE"),
    (["run", "configs/two_link.yaml", "--set", "selected.heuristic=swapp"],
     "Next: paramreduce run configs/two_link.yaml --set selected.heuristic=swap"),
    (["run", "configs/two_link.yaml", "--set", "selectd.n=3"],
     "Next: paramreduce run configs/two_link.yaml --set selected.n=3"),
    (["run", "configs/two_link.yaml", "--set", "n=3"],
     "Next: paramreduce run configs/two_link.yaml --set selected.n=3"),
    (["run", "configs/two_link.yaml", "--set", "selected.n=many"], "expected a whole number, for example 1"),
    (["run", "configs/two_link.yaml", "--jobs", "0"], "Example: paramreduce run configs/two_link.yaml"),
    (["run", "configs/two_link.yaml", "--results", "notes.txt"], "Example: paramreduce run"),
    (["run", "configs/two_link.yaml", "more"], "Example: paramreduce run"),
    (["reduce", "configs/two_link.yaml", "--results", "fresh"],
     "`paramreduce build-model configs/two_link.yaml --results fresh`"),
    (["sample", "configs/two_link.yaml"], "`paramreduce build-model configs/two_link.yaml`"),
    (["validate", "configs/two_link.yaml", "--set", "selected.n=3"],
     "`paramreduce build-model configs/two_link.yaml --set selected.n=3`"),
    (["report", "configs/two_link.yaml"], "`paramreduce build-model configs/two_link.yaml`"),
    (["reduce-terms", "configs/two_link.yaml", "--results", "done"], "such as `terms: {torque_error: 0.01}`"),
    (["process-log", "configs/two_link.yaml", "--results", "done"], "`paramreduce init ROBOT.urdf --log FILE`"),
    (["export"], "Next: paramreduce export configs/two_link.yaml"),
    (["export", "two_link"], "Next: paramreduce export configs/two_link.yaml"),
    (["export", "configs/two_link.yaml"], "`paramreduce build-model configs/two_link.yaml`"),
    (["export", "configs/two_link.yaml", "--format", "java"], "'c', 'casadi'"),
    (["export", "configs/two_link.yaml", "--results", "done", "--model", "swap:99"],
     "Next: paramreduce export configs/two_link.yaml --results done --model swap:7"),
    (["export", "configs/two_link.yaml", "--results", "done", "--model", "3"],
     "Next: paramreduce export configs/two_link.yaml --results done --model forward-selection:3"),
    (["export", "configs/two_link.yaml", "--results", "done", "--model", "best"],
     "Next: paramreduce export configs/two_link.yaml --results done --model best-subset:4"),
    (["export", "configs/two_link.yaml", "--lang", "matlab"],
     "Next: paramreduce export configs/two_link.yaml --format matlab"),
    (["export", "configs/two_link.yaml", "--results", "done", "--model", "terms"], "such as terms: {torque_error: 0.01}"),
    (["export", "configs/two_link.yaml", "--results", "done", "--format", "urdf"],
     "`paramreduce init ROBOT.urdf` writes"),
    (["export", "configs/two_link.yaml", "--results", "done", "--set", "selected.n=3"],
     "`paramreduce run configs/two_link.yaml --results done --set selected.n=3`"),
    (["check-data", "nothing.csv"], "there is no such file"),
    (["check-data", "log.csv"], "Write sampling.log.columns by hand"),
    (["inspect"], "Example: paramreduce inspect"),
    (["inspect", "."], "`paramreduce inspect done`"),
    (["inspect", "done/model"], "Did you mean done/model.h5?"),
    (["inspect", "samples.h5"], "is not a readable HDF5 file"),
    (["inspect", "done/reduction.h5", "--model", "best:3"],
     "Next: paramreduce inspect done/reduction.h5 --model best-subset:3"),
    (["compare", "done"], "paramreduce compare --help says more"),
    (["compare", "done", "dome"], "Did you mean done?"),
    (["compare", "done", "summary.json"], "Run `paramreduce run CONFIG`"),
    (["inspect", "two_link"], "Next: paramreduce run configs/two_link.yaml"),
    (["open", "configs/two_link.yaml"], "Run `paramreduce run configs/two_link.yaml`"),
    (["validate"], "Next: paramreduce validate configs/two_link.yaml"),
    (["table"], "Example: paramreduce table"),
    (["table", "."], "`paramreduce table done`"),
    (["open"], "Example: paramreduce open"),
    (["open", "."], "`paramreduce open done`"),
    (["open", "results/none"], "`paramreduce run CONFIG`"),
    (["init"], "`paramreduce init robot.urdf`"),
    (["init", "nothing.urdf"], "give the path of a URDF or MJCF"),
    (["init", "ur10"], "Next: paramreduce init --example ur10"),
    (["init", "one.urdf"], "Next: paramreduce init one.urdf --floating"),
    (["init", "--example", "pmua560"], "Next: paramreduce init --example puma560"),
    (["init", "--dh", "two_link"], "Next: paramreduce init --dh two_link --output configs/two_link_2.yaml"),
    (["version"], "see `paramreduce --version`"),
    (["check-data", "configs/two_link.yaml"], "paramreduce check-data RECORDING.csv configs/two_link.yaml"),
    (["identify", "configs/two_link.yaml"], "`paramreduce init ROBOT.urdf --log FILE`"),
    (["identify", "configs/two_link.yaml", "--results", "done"], "`paramreduce init ROBOT.urdf --log FILE`"),
    (["puma560"], "Next: paramreduce init --example puma560"),
    (["init", "--example", "mine"], "there is bogie"),
    (["reduce", "--samples", "samples.h5"], "Next: paramreduce reduce --samples samples.h5 --results results/my_samples"),
    (["reduce", "--samples", "sample.h5", "--results", "r"],
     "Next: paramreduce reduce --samples samples.h5 --results r"),
    (["completion", "tcsh"], "Example: paramreduce completion bash"),
    (["graph", "configs/two_link.yaml"], "paramreduce graph --help says more"),
]  # fmt: skip


@pytest.fixture
def folder(two_link_results, tmp_path, monkeypatch):
    """Where somebody has begun, with an earlier result and odd files."""
    (tmp_path / "configs").mkdir()
    for name, text in {
        "configs/two_link.yaml": (CONFIGS / "two_link.yaml").read_text(),
        "configs/empty.yaml": "robot: x\n",
        "configs/broken.yaml": "a: [1\n",
        "configs/nothing.yaml": "",
        "notes.txt": "hello\n",
        "one.urdf": '<robot name="r"><link name="a"/></robot>',
        "log.csv": "time,q1\n0,1\n",
        "summary.json": "{}",
        "samples.h5": "no HDF5",
    }.items():
        (tmp_path / name).write_text(text)
    shutil.copytree(two_link_results, tmp_path / "done")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(("words", "told"), MOVES, ids=lambda v: " ".join(v) if isinstance(v, list) else "")  # fmt: skip
def test_what_does_not_work_says_what_does(invoke, folder, words, told):
    said = invoke(*words, code=2)
    assert told in said.out + said.err
    suggested = re.findall(r"paramreduce (?:--help|[a-z-]+(?: \S+)*)", said.err.replace("`", "\n"))
    assert suggested  # something to type as it stands, of what is here
    for command in suggested:
        for path in re.findall(r"(?:configs|results)/[\w./-]+", command):
            assert (
                path in words
                or re.search("--(results|output)", command)
                or Path(path.rstrip(".")).exists()
            ), command
    assert "Traceback" not in said.err
    assert not (folder / "results").exists() or not list((folder / "results").rglob("*.h5"))


def test_results_are_named_by_their_robot(invoke, folder):
    shutil.copytree(folder / "done", folder / "results" / "two_link")
    for words in (["open", "two_link"], ["open", "results/two_link/report/index.html"]):
        assert f"Next: paramreduce {words[0]} results/two_link\n" in invoke(*words, code=2).err
    refused = invoke("validate", "results/two_link/model.h5", code=2).err
    assert "Next: paramreduce validate configs/two_link.yaml\n" in refused


def test_a_config_stands_for_its_results_and_results_for_their_config(invoke, folder):
    shutil.copytree(folder / "done", folder / "results" / "two_link")
    assert "results/two_link/report/index.html" in invoke("open", "configs/two_link.yaml").out
    by_config, by_folder = (
        invoke("inspect", word).out for word in ("configs/two_link.yaml", "done")
    )
    assert by_config == by_folder
    assert "validate: up to date, done/validation.h5" in invoke("validate", "done").out


@pytest.mark.parametrize(
    ("words", "next_one"),
    [
        (["report", "configs/two_link.yaml"], None),  # the message has the command
        (["run", "./configs/two_link.yaml", "--set", "selected.n=many"], None),
        (["run", "configs/two_link.yaml", "--set", "trajectories.file=none.json"], None),
        (["inspect", "done/reduction.h5", "--model=swap:99"], "inspect done/reduction.h5 --model=swap:7"),
        (["inspect", "done", "--model", "3"], "inspect done --model qr:3"),
        (["open", ".."], None),
        (["run", 300 * "a"], None),
    ],
    ids=lambda v: " ".join(v)[:60] if isinstance(v, list) else "",
)  # fmt: skip
def test_what_is_not_known_is_not_guessed(invoke, folder, words, next_one):
    said = re.findall(r"Next: paramreduce (.*)", invoke(*words, code=2).err)
    assert said == ([] if next_one is None else [next_one])


def test_a_hint_that_fails_hides_no_error(invoke, folder, monkeypatch):
    def broken(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("paramreduce_cli.cli.suggestions.find_project_above", broken)
    assert "there is no such file" in invoke("run", "configs/two_lnik.yaml", code=2).err
    assert "there is no option" in invoke("run", "--nothing", code=2).err


def test_in_another_folder_it_says_where_to_go(invoke, folder, monkeypatch):
    (folder / "configs" / "deep").mkdir()
    monkeypatch.chdir(folder / "configs" / "deep")
    said = invoke("run", "configs/two_link.yaml", code=2).err
    assert "Next: cd ../.. && paramreduce run configs/two_link.yaml" in said
    assert "cd ../.." in invoke().out
    monkeypatch.chdir(folder / "done")
    assert "paramreduce open ." in invoke().out


def test_without_any_robot_an_example_says_how_to_get_one(invoke, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "First: paramreduce init --example puma560" in invoke("run", code=2).err


@pytest.mark.parametrize("words", [["inspect", "results/two_link"], ["report", "configs/two_link.yaml"], ["open", "results/two_link"]], ids=" ".join)  # fmt: skip
def test_old_results_are_remade_with_their_config(invoke, folder, words, monkeypatch):
    shutil.copytree(folder / "done", folder / "results" / "two_link")
    with h5py.File(folder / "results/two_link/validation.h5", "r+") as file:
        file.attrs["schema"] = SCHEMA - 1
    (folder / "results/two_link/report/index.html").unlink()
    assert "`paramreduce run configs/two_link.yaml`" in invoke(*words, code=2).err


@pytest.mark.parametrize(
    ("words", "library", "extra"),
    [
        (["init", "arm.xml"], "mujoco", "mjcf"),
        (["check-data", "bag"], "rosbags.highlevel", "rosbag"),
        (["table", "done", "--parquet"], "pyarrow", "parquet"),
    ],
    ids=str,
)
def test_a_missing_extra_is_named(invoke, folder, monkeypatch, words, library, extra):
    (folder / "arm.xml").write_text("<mujoco><worldbody/></mujoco>")
    (folder / "bag").mkdir()
    (folder / "bag" / "metadata.yaml").write_text("")
    for name in [name for name in sys.modules if name.split(".")[0] == library.split(".")[0]]:
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setitem(sys.modules, library.split(".")[0], None)
    assert f"pip install 'paramreduce[{extra}]'" in invoke(*words, code=2).err


def test_without_a_command_it_says_what_to_do(invoke, tmp_path, monkeypatch, two_link_results):
    monkeypatch.chdir(tmp_path)
    assert "paramreduce init --example puma560" in invoke().out
    invoke("init", "--example", "two_link")
    assert "paramreduce run configs/two_link.yaml" in invoke().out
    shutil.copytree(two_link_results, tmp_path / "results" / "two_link")
    said = invoke().out
    for command in ("paramreduce open results/two_link", "paramreduce export configs/two_link.yaml"):  # fmt: skip
        assert command in said


def test_examples_bring_the_files_they_name(invoke, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said = invoke("init", "--example", "ur10").out
    for name in ("ur10.yaml", "logs/ur10.csv.gz", "logs/ur10.urdf"):
        assert (tmp_path / "configs" / name).read_bytes() == (CONFIGS / name).read_bytes()
        assert f"configs/{name}" in said
    (tmp_path / "configs" / "logs" / "ur10.urdf").write_text("mine")
    said = invoke("init", "--example", "ur10", code=2).err
    assert "configs/logs/ur10.urdf: exists already" in said
    invoke("init", "--example", "ur10", "--output", said.split("--output ")[-1].strip())


def test_json_is_a_line_for_every_event(invoke, folder):
    run = ("run", "configs/two_link.yaml", "--results", "done", "--json")
    lines = invoke(*run, settings=[ONE_FORMAT]).out.splitlines()
    events = [json.loads(line) for line in lines]
    assert [e["event"] for e in events if e["event"] != "progress"][-2:] == ["stage", "done"]
    assert events[-1]["selected"]["n"] == 4
    contents = json.loads(invoke("inspect", "done/model.h5", "--json").out)
    assert {"/base/columns", "/base/beta"} <= {one["name"] for one in contents["datasets"]}
    model = json.loads(invoke("inspect", "done", "--json").out)
    assert {one["name"] for one in model["parameters"]} == set(events[-1]["selected"]["parameters"])
    assert json.loads(invoke("compare", "done", "done", "--json").out)["agree"] is True
    (run,) = json.loads(invoke("table", "done", "--json").out)["runs"]
    assert run["n"] == 4


def test_a_log_keeps_what_is_said(invoke, folder):
    run = ("run", "configs/two_link.yaml", "--results", "done", "--log-file", "run.log")
    said = invoke(*run, settings=[ONE_FORMAT]).out
    lines = (folder / "run.log").read_text().splitlines()
    assert all(re.match(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d ", line) for line in lines)
    assert "$ paramreduce run configs/two_link.yaml" in lines[0]
    assert said.splitlines()[-1] in lines[-1]
    for line in said.splitlines():  # the table, too
        assert any(line.rstrip() in kept for kept in lines)


def test_doctor_says_that_the_cache_cannot_be_written(invoke, monkeypatch):
    monkeypatch.setenv("PARAMREDUCE_CACHE", "/sys/kernel")
    found = {one["what"]: one for one in json.loads(invoke("doctor", "--json").out)["findings"]}
    assert found["cache of compiled models"]["state"] == "slow"
    assert "/sys/kernel cannot " in found["cache of compiled models"]["found"]


def test_doctor_names_what_is_missing(invoke, monkeypatch):
    found = {one["what"]: one for one in json.loads(invoke("doctor", "--json").out)["findings"]}
    assert found["linear algebra"]["state"] == "ok"
    monkeypatch.setenv("CC", "gcc '")
    from paramreduce_cli.expressions.compiled import find_compiler

    find_compiler.cache_clear()
    assert "the variable CC holds no command" in " ".join(invoke("doctor", code=1).out.split())
    monkeypatch.delenv("CC")
    find_compiler.cache_clear()


def test_completion_is_what_the_shell_asks_for(invoke, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    invoke("completion", "bash", "--install")
    path = tmp_path / ".local/share/bash-completion/completions/paramreduce"
    assert "_PARAMREDUCE_COMPLETE=bash_complete" in path.read_text()


def test_a_report_older_than_what_it_is_of_is_said(invoke, folder):
    assert "changed since" not in invoke().out
    invoke("validate", "configs/two_link.yaml", "--results", "done", "--set", "selected.n=3")
    assert "validation.h5 changed since this report was made" in invoke("open", "done").err


def test_a_template_that_is_not_filled_in_is_said(invoke, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    invoke("init", "--dh", "my_arm", "--joints", "2")
    quick = ["report.formats=[svg]", "trajectories.count=1", "trajectories.test_count=1"]
    said = " ".join(invoke("run", "configs/my_arm.yaml", "--quiet", settings=quick).err.split())
    lines = (tmp_path / "configs/my_arm.yaml").read_text().splitlines()
    first = next(k for k, line in enumerate(lines, start=1) if "TODO" in line and k > 1)
    assert f"configs/my_arm.yaml: line {first}" in said


def test_messages_are_never_appended_to_something_else(invoke, folder):
    """A recording, say, for who has read of `init --log`."""
    before = (folder / "log.csv").read_text()
    said = invoke("check-data", "log.csv", "--log-file", "log.csv", code=2).err
    assert "is not a file of paramreduce's messages" in said
    assert (folder / "log.csv").read_text() == before
    (folder / "run.log").touch()
    for _ in range(2):
        invoke("inspect", "done", "--log-file", "run.log")
    assert (folder / "run.log").read_text().count("$ ") == 2
