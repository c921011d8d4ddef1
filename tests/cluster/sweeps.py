"""A sweep through Snakemake, and whether it made what plain runs make."""

import contextlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import h5py
import yaml

ROOT = Path(__file__).resolve().parents[2]
ROBOTS = ("two_link", "four_bar", "five_bar")
PARTS = {"optimize-trajectories": 2, "sample": 2, "reduce": 2}
ARTIFACTS = ("model.h5", "trajectories.h5", "samples.h5", "reduction.h5", "validation.h5")
SHORT = ["trajectories.starts=1", "trajectories.polished=1", "report.formats=[svg]",
         "validation.stability=false"]  # fmt: skip
"""The same stages in less time."""


def write_list(folder, robots, seeds):
    """A list of runs whose results go below a folder."""
    path = folder / "sweep.yaml"
    content = {
        "robots": [str(ROOT / "configs" / f"{robot}.yaml") for robot in robots],
        "seeds": list(range(seeds)),
        "variants": {"short": SHORT},
        "parts": PARTS,
        "results": str(folder / "results"),
    }
    path.write_text(yaml.safe_dump(content))
    return path


def command(listed, profile="local", **options):
    """Snakemake on a list."""
    words = [sys.executable, "-m", "snakemake", "--snakefile", ROOT / "pipelines" / "Snakefile"]
    words += ["--profile", ROOT / "pipelines" / "profiles" / profile, "--directory", listed.parent]
    for name, value in options.items():
        words += [f"--{name.replace('_', '-')}", str(value)]
    return [str(word) for word in [*words, "--quiet", "all", "--config", f"sweep={listed}"]]


def rules(listed):
    """Names of all rules for a list."""
    words = [word for word in command(listed) if word not in ("--quiet", "all")]
    found = subprocess.run([*words, "--list-rules"], check=True, capture_output=True, text=True)
    return found.stdout.split()


def plain_runs(folder, robots, seeds):
    """Digests of the same runs, each by one command, by run and file."""
    found = {}
    for robot in robots:
        for seed in range(seeds):
            name = f"{robot}-{seed}-short"
            words = [sys.executable, "-m", "paramreduce_cli", "run"]
            words += [ROOT / "configs" / f"{robot}.yaml", "--results", folder / name, "--quiet"]
            for change in [f"trajectories.seed={seed}", *SHORT]:
                words += ["--set", change]
            done = subprocess.run(
                list(map(str, words)), capture_output=True, text=True, check=False
            )
            assert done.returncode in (0, 1), done.stderr
            found[name] = digests(folder / name)
    return found


def digests(folder):
    """Of what a run has made, by file; nothing of what is not there."""
    result = {}
    for name in ARTIFACTS:
        with contextlib.suppress(OSError), h5py.File(folder / name) as file:
            result[name] = file.attrs["digest"]
    return result


def made(folder):
    """When finished files below a folder were made, as far as that shows: the time that it took, by file."""
    found = {}
    for name in ARTIFACTS:
        for path in folder.rglob(name):
            with contextlib.suppress(OSError), h5py.File(path) as file:
                found[path] = float(file.attrs["wall_seconds"])
    return found


def different(found, expected):
    """Files of runs that are not what plain runs made."""
    return [
        f"{run}/{name}"
        for run, own in expected.items()
        for name, digest in own.items()
        if digests(found / run).get(name) != digest
    ]


def killed_at_random(words, folder, longest, rng):
    """Start a sweep and kill it, or one of its jobs, at a random moment; False where it ended before."""
    with (folder / "killed.log").open("a") as log:
        process = subprocess.Popen(words, stdout=log, stderr=log, start_new_session=True)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(rng.uniform(0, longest))
            return False
        below = _below(process.pid)
        jobs = [
            pid for pid, text in below.items() if "paramreduce" in text and "snakemake" not in text
        ]
        victim = rng.choice(["a job", "Snakemake", "all"])
        if victim == "a job" and jobs:
            _kill(rng.choice(jobs))
        elif victim == "Snakemake":
            _kill(process.pid)
        else:
            for pid in [process.pid, *below]:
                _kill(pid)
        process.wait()
    return True


def _kill(pid):
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)


def _below(pid):
    """Processes below one, with their command lines."""
    found = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
                text = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode()
            except (OSError, ValueError):
                continue
            if parent == pid:
                own = int(entry.name)
                found |= {own: text} | _below(own)
    return found


LOOP = """
import numpy as np
from paramreduce_cli.terms.matrices import multiply_triangles
print(multiply_triangles(np.arange(12.0).reshape(2, 2, 3), np.ones((1, 2, 3))).tolist())
"""
"""Something that Numba compiles and keeps."""


def started_at_once(folder, count):
    """Start many jobs together that share empty caches; returns how many of them fail or differ.

    A job builds a model, which gcc compiles, and goes through a loop, which Numba does.
    """
    caches = {name: str(folder / "cache") for name in ("PARAMREDUCE_CACHE", "NUMBA_CACHE_DIR")}
    config = ROOT / "configs" / "two_link.yaml"
    build = [sys.executable, "-m", "paramreduce_cli", "build-model", str(config), "--quiet"]
    words = ["bash", "-c", '"$0" -c "$1" && "${@:2}"', sys.executable, LOOP, *build]
    jobs = [
        subprocess.Popen(
            [*words, "--results", str(folder / "starts" / str(k))], env={**os.environ, **caches},
            stdout=subprocess.PIPE, text=True,
        )
        for k in range(count)
    ]  # fmt: skip
    said = {job.communicate()[0] for job in jobs}
    failed = sum(job.returncode != 0 for job in jobs)
    found = set()
    for path in (folder / "starts").glob("*/model.h5"):
        with h5py.File(path) as file:
            found.add(file.attrs["digest"])
    return failed + len(found) - 1 + len(said) - 1
