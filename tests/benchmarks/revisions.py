"""CPU time of every stage before and after: another revision of this project beside the working tree.

    make benchmark BEFORE=REVISION

Both run on this machine in one go, in turns, each with what its own Makefile installs; a first
round that fills the caches is not counted.
"""

import argparse
import os
import subprocess
import tempfile
from pathlib import Path

import rich.box
import rich.console
import rich.table

ROOT = Path(__file__).resolve().parents[2]
STAGES = ("build-model", "optimize-trajectories", "sample", "reduce", "validate", "report")
ROUNDS = 2


def seconds(command, folder):
    """CPU seconds of a command and of all it starts."""
    process = subprocess.Popen(
        command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )
    said = process.stderr.read().decode()
    _, status, usage = os.wait4(process.pid, 0)
    if os.waitstatus_to_exitcode(status) not in (0, 1):  # 1: a model that is not accepted
        raise SystemExit(f"{' '.join(command)}:\n{said}")
    return usage.ru_utime + usage.ru_stime


def measured(tree, robot, results):
    """Of the start of the command line, and of every stage done anew."""
    program = str(tree / ".venv/bin/paramreduce")
    spent = {"--version": seconds([program, "--version"], tree)}
    for stage in STAGES:
        command = [program, stage, f"configs/{robot}.yaml", "--results", str(results), "--force"]
        spent[stage] = seconds(command, tree)
    return spent


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("before", help="a revision that git knows")
    parser.add_argument("--robot", default="puma560")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        before = Path(folder) / "before"
        worktree = ["git", "-C", str(ROOT), "worktree"]
        subprocess.run([*worktree, "add", "--quiet", "--detach", before, asked.before], check=True)
        try:
            subprocess.run(["make", "--quiet", ".venv/.installed"], cwd=before, check=True)
            trees = {"before": before, "after": ROOT}
            least = {}
            for turn in range(1 + ROUNDS):
                for name, tree in trees.items():
                    spent = measured(tree, asked.robot, Path(folder) / f"results-{name}")
                    if turn > 0:
                        known = least.setdefault(name, spent)
                        least[name] = {what: min(known[what], s) for what, s in spent.items()}
        finally:
            subprocess.run([*worktree, "remove", "--force", before], check=True)
    show(asked, least)


def show(asked, least):
    title = f"{asked.robot}: CPU seconds at {asked.before} and now, least of {ROUNDS}"
    table = rich.table.Table(
        "", "before", "after", "after / before", title=title, box=rich.box.SIMPLE
    )
    sums = {name: sum(spent[stage] for stage in STAGES) for name, spent in least.items()}
    for what in ("--version", *STAGES):
        one, other = least["before"][what], least["after"][what]
        table.add_row(what, f"{one:.1f}", f"{other:.1f}", f"{other / one:.2f}")
    one, other = sums["before"], sums["after"]
    table.add_row("all stages", f"{one:.1f}", f"{other:.1f}", f"{other / one:.2f}")
    rich.console.Console(width=100).print(table)


if __name__ == "__main__":
    main()
