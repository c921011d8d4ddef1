"""Sweeps through Snakemake here and on a Slurm of its own, and with kills, against plain runs."""

import argparse
import random
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import rich.console
import rich.table

from tests.cluster.scripted import scheduled, script_of
from tests.cluster.slurm import Slurm, missing
from tests.cluster.sweeps import (
    ROBOTS,
    command,
    different,
    killed_at_random,
    made,
    plain_runs,
    rules,
    started_at_once,
    write_list,
)

_LONGEST = 40.0
"""Before a kill, s."""
_LATEST = 25.0
"""Before a kill of Slurm's controller, s; a script's jobs take longer."""


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, default=len(ROBOTS))
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--daemons", type=int, default=5, help="Kills of Slurm's controller.")
    parser.add_argument("--seed", type=int, default=0, help="Of the kills.")
    parser.add_argument("--starts", type=int, default=100, help="At once, with an empty cache.")
    parser.add_argument(
        "--slurm", choices=["no", "script", "all"], default="all",
        help="On a Slurm of one node: nothing, the script alone, or Snakemake too.",
    )  # fmt: skip
    given = parser.parse_args()
    robots = ROBOTS[: given.robots]
    table = rich.table.Table("what", "runs", "equal to plain runs", "otherwise")
    lost = []

    def tell(what, found, expected):
        bad = different(found, expected)
        lost.extend(bad)
        if bad:  # to be looked at afterwards
            kept = Path(tempfile.mkdtemp(prefix="differs-"))
            shutil.copytree(folder, kept, dirs_exist_ok=True)
            print(f"{what}: kept in {kept}", flush=True)
        runs = len({name.partition("/")[0] for name in bad})
        table.add_row(what, str(len(expected)), str(len(expected) - runs), ", ".join(bad[:3]))

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        expected = plain_runs(folder / "plain", robots, given.seeds)

        def fresh(what):
            (folder / what).mkdir()
            return write_list(folder / what, robots, given.seeds), folder / what / "results"

        listed, results = fresh("local")
        subprocess.run(command(listed), check=True, stdout=subprocess.DEVNULL)
        tell("Snakemake on this machine", results, expected)
        listed, results = fresh("script")
        text = script_of(listed)
        for again in ("", ", and again"):
            calls = len(scheduled(listed.parent, text))
            tell(f"script for sbatch, {calls} calls{again}", results, expected)
        if given.starts:
            wrong = started_at_once(folder, given.starts)
            lost.extend(["starts"] * wrong)
            equal = str(given.starts - wrong)
            table.add_row(
                f"{given.starts} starts at once, empty cache", str(given.starts), equal, ""
            )
        if given.kills:
            lost.extend(["kills"] * kills(fresh, given, expected, tell))
        if given.slurm != "no":
            failed = on_slurm(folder, fresh, given, expected, tell, table)
            lost.extend(["Slurm"] * failed)
    rich.console.Console(width=110).print(table)
    sys.exit(bool(lost))


def kills(fresh, given, expected, tell):
    """Kill a job, Snakemake or everything; then the same command again, until all is done."""
    rng = random.Random(given.seed)
    failed = count = sweeps = 0
    while count < given.kills:
        listed, results = fresh(f"killed-{sweeps}")
        sweeps += 1
        words = command(listed)
        finished = {}
        # A sweep is killed a few times before it is left to end.
        for _ in range(min(5, given.kills - count)):
            if not killed_at_random(words, listed.parent, _LONGEST, rng):
                break
            count += 1
            finished |= made(results)
        with (listed.parent / "last.log").open("w") as log:
            done = subprocess.run(words, stdout=log, stderr=log, check=False)
        failed += done.returncode != 0
        after = made(results)
        again = [path for path, seconds in finished.items() if after.get(path) != seconds]
        failed += bool(again)
        what = f"killed at random moments, then ended ({count} kills so far; {len(again)} of {len(finished)} made twice)"
        tell(what, results, expected)
    return failed


def on_slurm(folder, fresh, given, expected, tell, table):
    """The same on a Slurm of one node, whose controller is killed at random moments."""
    needed = missing()
    if needed:
        table.add_row(f"Slurm: left out, {needed} is not there", "", "", "")
        return 0
    slurm = Slurm(folder / "daemons")
    try:
        rng = random.Random(given.seed)
        for k in range(given.daemons):
            listed, results = fresh(f"slurm-script-{k}")
            (listed.parent / "sweep.sh").write_text(script_of(listed))
            slurm.run("bash", listed.parent / "sweep.sh")
            moment = rng.uniform(0, _LATEST)
            slurm.kill_controller(after=moment)
            slurm.wait_until_idle()
            # A controller forgets what was submitted in its last seconds: the same script goes on.
            slurm.run("bash", listed.parent / "sweep.sh")
            slurm.wait_until_idle()
            what = f"script on a Slurm of one node, controller killed after {moment:.0f} s, script again"
            tell(what, results, expected)
        return snakemake_on(slurm, fresh, expected, tell) if given.slurm == "all" else 0
    finally:
        slurm.stop()


def snakemake_on(slurm, fresh, expected, tell):
    """Snakemake's jobs on this Slurm; of several runs one for everything of each, as stages here take seconds."""
    listed, results = fresh("slurm")
    words = command(
        listed, "slurm", slurm_status_command="squeue", slurm_init_seconds_before_status_checks=5,
        latency_wait=20,
    )  # fmt: skip
    groups = [f"{rule}=run" for rule in rules(listed) if rule not in ("all", "table")]
    at = words.index("--quiet")
    words[at:at] = ["--slurm-no-account", *(["--groups", *groups] if len(expected) > 1 else [])]
    with (listed.parent / "snakemake.log").open("w") as log:
        process = subprocess.Popen(words, env=slurm.environment, stdout=log, stderr=log)
        slurm.kill_controller(after=45)
        process.wait()
    if process.returncode != 0:
        print((listed.parent / "snakemake.log").read_text()[-3000:])
        return 1
    tell("Snakemake on a Slurm of one node, controller killed once", results, expected)
    return 0


if __name__ == "__main__":
    main()
