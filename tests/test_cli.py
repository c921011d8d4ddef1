import json
import os
import re
import signal
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest
import yaml
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


@pytest.fixture
def brought(tmp_path):
    """An observation matrix of the user's own, with nothing about a robot."""
    rng = np.random.default_rng(0)
    W = rng.normal(size=(300, 7))
    W[:, 6] = W[:, 0] - W[:, 1]
    phi = np.array([5.0, 0.1, 3.0, 0, 0, 1.0, 0])
    path = tmp_path / "mine.h5"
    with h5py.File(path, "w") as file:
        file["estimation/W"] = W
        file["estimation/tau"] = (W @ phi).reshape(-1, 2)
    return path


def test_reduce_an_observation_matrix_without_any_config(invoke, brought, tmp_path):
    code, out, _ = invoke("reduce", "--samples", brought, "--results", tmp_path / "r")
    assert code == 0
    with h5py.File(tmp_path / "r" / "reduction.h5") as file:
        order = file["forward-selection/order"][:]
        errors = file["forward-selection/torque_error"][:]
        assert set(order[:3]) <= {0, 2, 5, 6, 1}
        assert errors[3] < 1e-12
        assert file["rank"][()] == 6
        assert file["qr/minimum_norm"][:].tolist() == [False] * 6 + [True]
    code, out, _ = invoke("inspect", tmp_path / "r" / "reduction.h5", "--model", "qr:6")
    assert code == 0
    assert "p1" in out


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda f: f.__delitem__("estimation/tau"), "/estimation/tau is missing"),
        (lambda f: f.__delitem__("estimation/W"), "/estimation/W is missing"),
        (lambda f: f["estimation/W"].__setitem__((7, 3), np.nan), "not finite"),
        (lambda f: f.__setitem__("nominal_torque", [1.0, 2.0, 3.0]), "nominal_torque must hold 2"),
        (lambda f: f.__setitem__("nominal_torque", [1.0, 0.0]), "no torque to weigh"),
        (lambda f: f.__setitem__("parameters/names", ["a", "b"]), "7 different names"),
        (lambda f: f["estimation/tau"].__setitem__((...,), 0.0), "no torque to weigh"),
    ],
)
def test_observation_matrices_that_do_not_fit(invoke, brought, tmp_path, change, says):
    with h5py.File(brought, "a") as file:
        change(file)
    code, _, err = invoke("reduce", "--samples", brought, "--results", tmp_path / "r")
    assert code == 2
    assert says in err
    assert not (tmp_path / "r" / "reduction.h5").exists()


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("estimation/trajectory", np.zeros(7), "150 finite numbers"),
        ("estimation/trajectory", np.full(150, -1.0), "0, 1, 2"),
        ("estimation/time", np.full(150, np.nan), "150 finite numbers"),
        ("estimation/z", np.zeros((3, 2)), "(150, 2)"),
        ("parameters/names", np.arange(7), "must hold text"),
    ],
)
def test_extras_of_an_observation_matrix_are_checked(invoke, brought, tmp_path, name, value, says):
    with h5py.File(brought, "a") as file:
        file[name] = value
    code, _, err = invoke("reduce", "--samples", brought, "--results", tmp_path / "r")
    assert code == 2
    assert says in err


@pytest.mark.parametrize(
    ("W", "says"),
    [
        (np.zeros((300, 7)), "no column"),
        (np.zeros((0, 7)), "empty"),
        (np.full((300, 7), 1e308), "too large"),
        (np.ones((300, 7)) * 1j, "real numbers"),
        (np.random.default_rng(0).normal(size=(4, 30)), "4 rows are too few for 30 parameters"),
    ],
)
def test_observation_matrices_with_nothing_to_choose_from(invoke, tmp_path, W, says):
    with h5py.File(tmp_path / "mine.h5", "w") as file:
        file["estimation/W"] = W
        file["estimation/tau"] = np.random.default_rng(1).normal(size=(len(W) // 2, 2))
    code, _, err = invoke("reduce", "--samples", tmp_path / "mine.h5", "--results", tmp_path / "r")
    assert code == 2
    assert says in err


def test_triangular_factors_of_others_are_not_trusted(invoke, brought, tmp_path):
    with h5py.File(brought, "a") as file:
        file["estimation/factors"] = np.zeros((1, 2, 8, 8))
    code, _, _ = invoke("reduce", "--samples", brought, "--results", tmp_path / "r")
    assert code == 0
    with h5py.File(tmp_path / "r" / "reduction.h5") as file:
        assert file["rank"][()] == 6


def test_samples_of_another_robot_with_a_config(invoke, brought, two_link_copy):
    code, _, err = invoke("reduce", TWO_LINK, "--samples", brought, "--results", two_link_copy)
    assert code == 2
    assert "another robot" in err


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


def test_brought_coefficients_repeat_everything_after_the_optimiser(
    invoke, two_link_results, tmp_path
):
    summary = two_link_results / "report" / "summary.json"
    code, _, _ = invoke(
        "run", TWO_LINK, "--results", tmp_path, "--quiet", "--set", f"trajectories.file={summary}"
    )
    assert code == 0
    code, out, _ = invoke("compare", summary, tmp_path)
    assert code == 0, out


def test_brought_coefficients_of_another_robot(invoke, two_link_results, tmp_path):
    summary = two_link_results / "report" / "summary.json"
    code, _, err = invoke(
        "run",
        CONFIGS / "puma560.yaml",
        "--results",
        tmp_path,
        "--set",
        f"trajectories.file={summary}",
    )
    assert code == 2
    assert "2 joints, but puma560 has 6" in err


def test_brought_states_and_torques(invoke, two_link_results, tmp_path, write_config):
    with h5py.File(two_link_results / "samples.h5") as file:
        for which in ("estimation", "validation"):
            columns = [file[f"{which}/{key}"][:] for key in ("z", "dz", "ddz", "tau")]
            header = ",".join(
                ["t", *(f"{k}{j}" for k in ("z", "dz", "ddz", "tau") for j in (1, 2))]
            )
            table = np.column_stack([file[f"{which}/time"][:], *columns])
            np.savetxt(tmp_path / f"{which}.csv", table, delimiter=",", header=header, comments="")
    sampling = "sampling:\n  estimation_file: estimation.csv\n  validation_file: validation.csv\n\nselected:"
    path = write_config(("selected:", sampling))
    code, out, _ = invoke("run", path, "--results", tmp_path / "r")
    assert code == 0
    assert "optimize-trajectories" not in out
    found, expected = (
        json.loads((folder / "report" / "summary.json").read_text())["selected"]["torque_error"]
        for folder in (tmp_path / "r", two_link_results)
    )
    assert found["estimation"] == pytest.approx(expected["estimation"], rel=1e-6)
    assert found["validation"] == pytest.approx(expected["validation"], rel=1e-6)


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
    small = [
        "--set",
        "trajectories.count=1",
        "--set",
        "trajectories.starts=1",
        "--set",
        "trajectories.polished=1",
    ]
    code, _, err = invoke("run", path, "--results", tmp_path / "r", "--quiet", *small)
    assert code in (0, 1), err


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


def slow_config(tmp_path):
    data = yaml.safe_load((CONFIGS / "puma560.yaml").read_text())
    data["trajectories"].update(count=12, starts=2, polished=1)
    path = tmp_path / "puma560.yaml"
    path.write_text(yaml.safe_dump(data))
    return path


def slow_run(tmp_path):
    """A run that takes a while, as a command line of its own."""
    command = [sys.executable, "-m", "paramreduce_cli", "run", slow_config(tmp_path)]
    return [*command, "--results", tmp_path / "r"]


def test_interrupted_with_ctrl_c_it_goes_on_with_what_is_missing(tmp_path):
    config = slow_config(tmp_path)
    command = [
        sys.executable,
        "-m",
        "paramreduce_cli",
        "run",
        config,
        "--results",
        tmp_path / "r",
        "--jobs",
        "1",
    ]
    parts = tmp_path / "r" / "trajectories.h5.parts"
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        deadline = time.monotonic() + 60
        while len(list(parts.glob("*.h5"))) < 2 and time.monotonic() < deadline:
            time.sleep(0.05)
        os.killpg(process.pid, signal.SIGINT)
        _, err = process.communicate(timeout=30)
    kept = sorted(p.name for p in parts.glob("*.h5"))
    assert process.returncode == 130, err
    assert "Interrupted" in err
    assert "Traceback" not in err
    assert len(kept) >= 2
    assert not (tmp_path / "r" / "trajectories.h5").exists()
    done = subprocess.run(
        [*command[:3], "optimize-trajectories", config, "--results", tmp_path / "r"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0
    assert done.stderr.count("kept from before") == len(kept)
    assert (tmp_path / "r" / "trajectories.h5").exists()
    assert not parts.exists()


def test_a_polite_kill_leaves_no_process_behind(tmp_path):
    command = slow_run(tmp_path)
    parts = tmp_path / "r" / "trajectories.h5.parts"
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        deadline = time.monotonic() + 60
        while not list(parts.glob("*.h5")) and time.monotonic() < deadline:
            time.sleep(0.05)
        process.terminate()
        _, err = process.communicate(timeout=30)
    assert process.returncode == 130, err
    deadline = time.monotonic() + 15
    while _session_alive(process.pid) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not _session_alive(process.pid)


def _session_alive(group):
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def test_killed_it_leaves_no_lock_behind(tmp_path):
    command = slow_run(tmp_path)
    with subprocess.Popen(
        command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL, start_new_session=True
    ) as process:
        deadline = time.monotonic() + 60
        while not (tmp_path / "r" / "model.h5").exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        os.killpg(process.pid, signal.SIGKILL)
    done = subprocess.run(
        [*command[:3], "build-model", command[4], "--results", tmp_path / "r"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
