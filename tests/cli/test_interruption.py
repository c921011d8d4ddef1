import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import TWO_LINK

PARAMREDUCE = [sys.executable, "-m", "paramreduce_cli"]


@pytest.fixture
def arguments(write_config, tmp_path):
    """Of a run that takes a while."""
    slow = ("  count: 2\n", "  count: 10\n")
    return [write_config(slow, ("harmonics: 2", "harmonics: 6")), "--results", tmp_path / "r"]


def finish(*command):
    return subprocess.run([*PARAMREDUCE, *command], capture_output=True, text=True, check=False)


def started(command):
    pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([*PARAMREDUCE, *command], start_new_session=True, **pipes)


def wait_until(condition, seconds=60):
    deadline = time.monotonic() + seconds
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.05)


def test_interrupted_with_ctrl_c_it_goes_on_with_what_is_missing(arguments, tmp_path):
    parts = tmp_path / "r" / "trajectories.h5.items"
    with started(["run", *arguments, "--jobs", "1"]) as process:
        wait_until(lambda: len(list(parts.glob("*.h5"))) >= 2)
        os.killpg(process.pid, signal.SIGINT)
        _, err = process.communicate(timeout=30)
    kept = sorted(p.name for p in parts.glob("*.h5"))
    assert process.returncode == 130, err
    assert "Interrupted" in err
    assert "Traceback" not in err
    assert len(kept) >= 2
    assert not (tmp_path / "r" / "trajectories.h5").exists()
    done = finish("optimize-trajectories", *arguments, "--verbose")
    assert done.returncode == 0
    assert f"{len(kept)} kept from before" in done.stderr
    assert (tmp_path / "r" / "trajectories.h5").exists()
    assert not parts.exists()


def test_a_polite_kill_leaves_no_process_behind(arguments, tmp_path):
    with started(["run", *arguments]) as process:
        wait_until(lambda: list((tmp_path / "r" / "trajectories.h5.items").glob("*.h5")))
        process.terminate()
        _, err = process.communicate(timeout=30)
    assert process.returncode == 130, err
    wait_until(lambda: not _session_alive(process.pid), 15)
    assert not _session_alive(process.pid)


def _session_alive(group):
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def test_killed_it_leaves_no_lock_behind(arguments, tmp_path):
    with started(["run", *arguments]) as process:
        wait_until((tmp_path / "r" / "model.h5").exists)
        os.killpg(process.pid, signal.SIGKILL)
    done = finish("build-model", *arguments)
    assert done.returncode == 0, done.stderr


def workers_of(process):
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    return children.read_text().split() if children.exists() else []


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="processes are seen in /proc")
@pytest.mark.parametrize("later", [0.0, 0.4, 1.2])
def test_workers_end_with_a_parent_that_is_killed_while_they_start(two_link_copy, later):
    arguments = [TWO_LINK, "--results", two_link_copy]
    many = ["--jobs", "2", "--set", "trajectories.count=200"]
    with started(["optimize-trajectories", *arguments, *many]) as process:
        wait_until(lambda: len(workers_of(process)) >= 2)
        time.sleep(later)
        process.kill()
        process.wait()
        wait_until(lambda: not _session_alive(process.pid), 15)
        assert not _session_alive(process.pid)
