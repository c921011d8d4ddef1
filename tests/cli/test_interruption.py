import os
import signal
import subprocess
import sys
import time

import yaml
from conftest import CONFIGS


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
