"""The script for Slurm with an sbatch that does what it is given at once, and counts."""

import os
import subprocess
import sys

_SBATCH = """#!/usr/bin/env bash
echo "$@" >> {folder}/calls
for word; do
  case "$word" in
    --array=1-*) count=${{word#--array=1-}};;
    *) command="$word";;
  esac
done
for task in $(seq "$count"); do
  {run} SLURM_ARRAY_TASK_ID=$task bash -c "$command"
done
wc -l < {folder}/calls
"""


def script_of(listed):
    """What is printed for a list of runs."""
    words = [sys.executable, "-m", "paramreduce_cli", "graph"]
    words += ["--format", "slurm", "--sweep", listed]
    return subprocess.run(words, check=True, capture_output=True, text=True).stdout


def scheduled(folder, text, *, run=True):
    """Run a script with this sbatch; returns the calls of it so far.

    Args:
        folder: For the script and what it calls.
        text: The script.
        run: Whether the jobs are done too.
    """
    (folder / "bin").mkdir(exist_ok=True)
    sbatch = folder / "bin" / "sbatch"
    sbatch.write_text(_SBATCH.format(folder=folder, run="" if run else ": "))
    sbatch.chmod(0o755)
    (folder / "sweep.sh").write_text(text)
    environment = {**os.environ, "PATH": f"{folder / 'bin'}:{os.environ['PATH']}"}
    words = ["bash", folder / "sweep.sh"]
    subprocess.run(words, check=True, env=environment, stdout=subprocess.DEVNULL)
    return (folder / "calls").read_text().splitlines()
