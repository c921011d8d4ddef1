import json
import re

import h5py
import pytest
from conftest import CONFIGS

from paramreduce_cli.pipeline import pipeline

COMMANDS = [stage.name for stage in pipeline()] + [
    "run",
    "schema",
    "init",
    "inspect",
    "compare",
    "table",
    "graph",
    "export",
]
TWO_LINK = CONFIGS / "two_link.yaml"


def test_help_names_every_command(invoke):
    code, out, _ = invoke("--help")
    assert code == 0
    for command in COMMANDS:
        assert f"  {command} " in out


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself_with_an_example(invoke, command):
    code, out, _ = invoke(command, "--help")
    assert code == 0
    assert "Example: paramreduce " + command in out.replace("\n  ", " ")


@pytest.mark.parametrize("stage", pipeline(), ids=lambda s: s.name)
def test_every_stage_says_what_it_reads_and_writes(invoke, stage):
    _, out, _ = invoke(stage.name, "--help")
    assert re.search(r"Reads .*; writes", out.replace("\n  ", " "))


def test_a_full_run_ends_with_a_table_and_the_report(invoke, tmp_path):
    code, out, err = invoke("run", TWO_LINK, "--results", tmp_path / "r", "--jobs", 2)
    assert code == 0
    assert "forward-selection" in out
    assert f"Report: {tmp_path / 'r' / 'report' / 'index.html'}" in out
    assert "validation-0000: done, kappa" in err  # plain lines, as there is no terminal
    code, out, err = invoke("run", TWO_LINK, "--results", tmp_path / "r", "--quiet")
    assert (code, out, err) == (0, "", "")


def test_stages_one_by_one_and_again(invoke, tmp_path):
    for again in (False, True):
        for stage in pipeline():
            code, out, _ = invoke(
                stage.name, TWO_LINK, "--results", tmp_path, "--set", "trajectories.starts=1"
            )
            assert code == 0
            assert ("up to date" in out) == again


def test_not_accepted_is_exit_code_1_with_the_sentence(invoke, two_link_copy, write_config):
    path = write_config(("torque_error_validation: 0.05", "torque_error_validation: 1e-4"))
    code, _, err = invoke("validate", path, "--results", two_link_copy)
    assert code == 1
    assert (
        "Not accepted: forward-selection with 4 parameters is not accepted: torque error validation"
        in err
    )
    code, _, err = invoke("run", path, "--results", two_link_copy)
    assert code == 1
    assert (two_link_copy / "report" / "summary.json").exists()
    assert invoke("validate", path, "--results", two_link_copy)[0] == 1  # also when up to date


def test_stages_without_their_inputs_say_what_to_run(invoke, tmp_path):
    code, _, err = invoke("reduce", TWO_LINK, "--results", tmp_path)
    assert code == 2
    assert "paramreduce build-model" in err
    invoke("build-model", TWO_LINK, "--results", tmp_path)
    assert "paramreduce sample" in invoke("reduce", TWO_LINK, "--results", tmp_path)[2]


def test_an_older_schema_is_refused_by_stages_and_rebuilt_by_run(invoke, two_link_copy):
    with h5py.File(two_link_copy / "model.h5", "a") as file:
        file.attrs["schema"] = 0
    code, _, err = invoke("sample", TWO_LINK, "--results", two_link_copy, "--force")
    assert code == 2
    assert "paramreduce run" in err
    assert invoke("run", TWO_LINK, "--results", two_link_copy, "--quiet")[0] == 0


def test_stale_inputs_are_remarked_on(invoke, two_link_copy):
    code, _, err = invoke(
        "reduce", TWO_LINK, "--results", two_link_copy, "--set", "sampling.points=50"
    )
    assert code == 0
    assert "samples.h5 was made with another sampling section" in err


def test_wrong_config_is_exit_code_2_and_leaves_artifacts_alone(
    invoke, two_link_copy, write_config
):
    before = {p: p.read_bytes() for p in two_link_copy.rglob("*") if p.is_file()}
    path = write_config(("count: 2", "count: 0"))
    code, _, err = invoke("run", path, "--results", two_link_copy)
    assert code == 2
    assert f"Error: {path}, line 20: trajectories.count" in err
    assert all(p.read_bytes() == content for p, content in before.items())


def test_a_folder_in_use(invoke, two_link_copy):
    from paramreduce_cli.artifacts.store import Store

    with Store(two_link_copy).locked():
        code, _, err = invoke("run", TWO_LINK, "--results", two_link_copy)
    assert code == 2
    assert "another run is using this folder" in err


def test_anothers_robot_folder(invoke, two_link_copy, write_config):
    path = write_config(("robot: two_link", "robot: other"))
    code, _, err = invoke("reduce", path, "--results", two_link_copy)
    assert code == 2
    assert "belongs to the robot two_link" in err


def test_named_base_columns_that_are_none(invoke, tmp_path):
    for name in ("mz_upper", "Iyy_fore"):
        code, _, err = invoke(
            "build-model", TWO_LINK, "--results", tmp_path, "--set", f"model.base_columns=[{name}]"
        )
        assert code == 2
        assert name in err


def test_arms_of_one_joint_get_their_report(invoke, tmp_path, write_config):
    """Nothing but an inertia about a vertical axis: its mass matrix costs no operation."""
    path = write_config(
        ("  gravity: [0, -9.81, 0]", "  gravity: [0, 0, -9.81]"),
        ("      - {name: fore, a: 0.5}\n", ""),
        (
            "    fore: {m: 1.0, com: [0.2, 0.01, 0], inertia_com: [5e-4, 0, 0, 0.0135, 0, 0.0135]}\n",
            "",
        ),
        ("nominal_torque: [20, 5]", "nominal_torque: 20"),
        ("  n: 4", "  n: 1"),
    )
    code, _, err = invoke("run", path, "--results", tmp_path / "r", "--quiet")
    assert code == 0, err


def test_compare_tells_what_differs(invoke, two_link_copy, tmp_path):
    summary = json.loads((two_link_copy / "report" / "summary.json").read_text())
    summary["validation"]["qr"][1]["operations"]["inverse"] += 1
    other = tmp_path / "other.json"
    other.write_text(json.dumps(summary))
    code, out, _ = invoke("compare", two_link_copy, other)
    assert code == 1
    assert "operations.inverse, qr, n = 2" in out
    assert invoke("compare", two_link_copy, other, "--only", "kappa")[0] == 0
    code, _, err = invoke("compare", two_link_copy, tmp_path / "none.json")
    assert code == 2
    code, _, err = invoke("compare", two_link_copy, other, "--tolerance", "speed=1")
    assert code == 2
    assert "kappa" in err


def test_inspect_shows_contents_and_provenance(invoke, two_link_results):
    code, out, _ = invoke("inspect", two_link_results / "model.h5")
    assert code == 0
    for text in ("robot: two_link", "stage: build-model", "/base/beta", "6 x 14"):
        assert text in out
    code, _, err = invoke("inspect", two_link_results / "reduction.h5", "--model", "qr:99")
    assert code == 2
    assert "qr:1...7" in err


def test_init_writes_a_config_that_runs(invoke, tmp_path):
    path = tmp_path / "configs" / "my_arm.yaml"
    code, _, _ = invoke("init", "--dh", "my_arm", "--joints", 3, "--output", path)
    assert code == 0
    code, _, err = invoke("init", "--dh", "my_arm", "--output", path)
    assert code == 2
    assert "exists already" in err
    small = ("trajectories.count=1", "trajectories.starts=1", "trajectories.polished=1")
    small = [part for setting in small for part in ("--set", setting)]
    code, _, err = invoke("run", path, "--results", tmp_path / "r", "--quiet", *small)
    assert code == 0, err


def test_schema_is_json_schema(invoke):
    code, out, _ = invoke("schema")
    assert code == 0
    assert json.loads(out)["properties"]["robot"]


@pytest.mark.parametrize(
    "arguments", [["reduce"], ["run"], ["nonsense"], ["run", "a", "--jobs", "0"]]
)
def test_wrong_usage(invoke, arguments):
    code, out, err = invoke(*arguments)
    assert code == 2
    assert "Traceback" not in out + err
