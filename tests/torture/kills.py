"""Runs killed at random moments: the same command again ends with the same numbers."""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter

import h5py

from tests.torture import CONFIG

_ARTIFACTS = ("model.h5", "trajectories.h5", "samples.h5", "reduction.h5", "validation.h5")
_SIGNALS = (signal.SIGKILL, signal.SIGINT, signal.SIGTERM)
_PATIENCE = 5.0
"""Seconds in which the processes of a run that was killed end."""


def start(folder, config=CONFIG):
    command = [sys.executable, "-m", "paramreduce_cli", "run", config, "--results", folder]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    settings = ["--quiet", "--jobs", "2", "--set", "report.formats=[png,svg]"]
    return subprocess.Popen([*command, *settings], start_new_session=True, **quiet)


def digests(folder):
    """Digests of the contents of all artifacts, by name."""
    found = {}
    for name in _ARTIFACTS:
        with h5py.File(folder / name) as file:
            found[name] = file.attrs["digest"]
    return found


def alive(group):
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def try_kills(folder, count, seed=0):
    """Kill runs, the parent alone or all of its processes, and run again.

    Args:
        folder: For results.
        count: How many runs.
        seed: Of moments and signals.

    Returns:
        How often each thing happened.
    """
    chance = random.Random(seed)
    started = time.monotonic()
    assert start(folder / "whole").wait() == 0
    usual, expected = time.monotonic() - started, digests(folder / "whole")
    found = Counter()
    for _ in range(count):
        shutil.rmtree(folder / "killed", ignore_errors=True)
        process = start(folder / "killed")
        time.sleep(chance.uniform(0, usual))
        which = chance.choice(_SIGNALS)
        if process.poll() is None:
            (os.kill if chance.random() < 0.5 else os.killpg)(process.pid, which)
        process.wait()
        deadline = time.monotonic() + _PATIENCE
        while alive(process.pid) and time.monotonic() < deadline:
            time.sleep(0.05)
        left = alive(process.pid)
        found["a process outlived it" if left else again(folder / "killed", expected)] += 1
    return found


def again(folder, expected):
    """What running again ends with: equal artifacts, or what is wrong."""
    code = start(folder).wait()
    if code:
        return f"exit {code}"
    unequal = [name for name, digest in digests(folder).items() if digest != expected[name]]
    return f"{', '.join(unequal)} not equal" if unequal else "equal"
