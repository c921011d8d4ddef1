"""CPU seconds and memory of whole commands beside what they may take.

Limits are for a quiet machine of two cores of 2024; `make benchmark BEFORE=REVISION` gives ratios that hold on any.
"""

import itertools
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import rich.box
import rich.console
import rich.table
import yaml

from paramreduce_cli.artifacts.store import load_file
from paramreduce_cli.lean.formulations import find_formulations
from paramreduce_cli.multibody.base_parameters import choose_base, find_affecting_columns
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.records import ProofStatus, Reduction
from paramreduce_cli.reduction.criteria.torque import TorqueObjective
from paramreduce_cli.reduction.task import Effort, SelectionTask, run
from tests.benchmarks.growth import ANGLES, chain
from tests.benchmarks.random_columns import drawn
from tests.cli.test_odd_inputs import ALIASES
from tests.conftest import dh, random_states
from tests.selecting import problem

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = (sys.executable, "-m", "paramreduce_cli")
MANY_KEYS = "".join(f"k{k}: 1\n" for k in range(30_000))
TIMES = 3
"""Of commands that take less than a second; the least counts."""


@dataclass(frozen=True)
class Spent:
    """What a command took with all that it started."""

    cpu: float
    wall: float
    memory: float
    """MB, of its largest process, and no less than this one's, which it began as."""


def spent(*arguments, times=1, codes=(0, 1), **environment):
    """The least of several runs of a command.

    Args:
        arguments: Of paramreduce.
        times: How often it is run.
        codes: It may end with; 1 is a model that is not accepted.
        environment: Changes of this process's.

    Raises:
        SystemExit: It failed.
    """
    found = []
    for _ in range(times):
        started = time.perf_counter()
        process = subprocess.Popen(
            [*PROGRAM, *map(str, arguments)], cwd=ROOT, env={**os.environ, **environment},
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        )  # fmt: skip
        said = process.stderr.read().decode()
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - started
        if os.waitstatus_to_exitcode(status) not in codes:
            raise SystemExit(f"{' '.join(map(str, arguments))}:\n{said}")
        found.append(Spent(usage.ru_utime + usage.ru_stime, wall, usage.ru_maxrss / 1e3))
    return min(found, key=lambda one: one.cpu)


def branches():
    """Joints of a humanoid of 32: two in the torso, two in the head, seven in each limb."""
    parents = {"torso1": None, "torso2": "torso1", "head1": "torso2", "head2": "head1"}
    for limb, root in (("right_arm", "torso2"), ("left_arm", "torso2"), ("right_leg", None), ("left_leg", None)):  # fmt: skip
        for k in range(7):
            parents[f"{limb}{k + 1}"] = f"{limb}{k}" if k else root
    return parents


def config(folder, name, parents):
    """A config of right-angled joints with bodies of a kilogram; its path."""
    rows = [
        (joint, parent, "revolute", 0.1 * (k % 3), float(angle), 0.2 * (k % 2))
        for k, ((joint, parent), angle) in enumerate(
            zip(parents.items(), itertools.cycle(ANGLES), strict=False)
        )
    ]
    description = dh(rows)
    for joint in description["dh"]["joints"]:
        if joint["parent"] is None:
            del joint["parent"]
    body = {"m": 1.0, "com": [0.1, 0.02, 0.03], "inertia_com": [0.01, 0, 0, 0.02, 0, 0.03]}
    text = yaml.safe_dump({
        "robot": name,
        "description": {"gravity": [0, 0, -9.81], **description},
        "parameter_sets": {"drawn": dict.fromkeys(parents, body)},
        "trajectories": {
            "count": 1, "validation_count": 1, "points": 500, "position_limits": [-2, 2], "velocity_limits": 3,
            "polished": 1,
        },
        "reduction": {"heuristics": ["forward-selection"]},
        "selected": {"heuristic": "forward-selection", "n": 20},
    })  # fmt: skip
    path = folder / f"{name}.yaml"
    path.write_text(text)
    return path


def serial(n):
    """Joints of a chain."""
    return {f"j{k + 1}": f"j{k}" if k else None for k in range(n)}


def of_the_shell(folder):
    """What is typed most."""
    results = folder / "two_link"
    spent("run", "configs/two_link.yaml", "--results", results, "--set", "report.formats=[svg]")
    for arguments in (
        ["--version"],
        ["--help"],
        ["inspect", results / "model.h5"],
        ["inspect", results],
    ):
        shown = " ".join(Path(argument).name for argument in map(str, arguments))
        yield shown, spent(*arguments, times=TIMES).cpu, 0.4, "CPU s"
    for what, text in {"aliases of aliases": ALIASES, "30,000 unknown keys": MANY_KEYS}.items():
        (folder / "odd.yaml").write_text(text)
        found = spent("run", folder / "odd.yaml", times=TIMES, codes=(2,))
        yield f"a config of {what}, refused", found.cpu, 1, "CPU s"


def of_papers_systems(folder):
    """The paper's two, warm; the PUMA with empty caches too; and how many threads small matrices are given."""
    puma = ["run", "configs/puma560.yaml", "--jobs", 2, "--results", folder / "puma560", "--force"]
    caches = {"PARAMREDUCE_CACHE": str(folder / "cache"), "NUMBA_CACHE_DIR": str(folder / "cache")}
    yield "puma560, caches empty", spent(*puma, **caches).cpu, 120, "CPU s"
    yield "puma560", spent(*puma, **caches).cpu, 70, "CPU s"
    without = spent(*puma, "--set", "terms=null", **caches)
    yield "puma560, without reduce-terms", without.cpu, 70, "CPU s"
    sampled = spent("sample", *puma[1:2], *puma[4:], **caches)
    yield "sample of puma560: CPU / wall", sampled.cpu / sampled.wall, 1.1, ""
    hexaglide = [
        "configs/hexaglide.yaml",
        "--jobs",
        2,
        "--results",
        folder / "hexaglide",
        "--force",
    ]
    found = spent("run", *hexaglide, **caches)
    yield "hexaglide", found.cpu, 300, "CPU s"
    yield "hexaglide", found.wall / 60, 3, "min"
    best = ["--set", "reduction.heuristics=[best-subset]", "--set", "validation.stability=false"]
    (folder / "hexaglide" / "reduction.h5").unlink()  # whose proofs it would go on from
    found = spent("reduce", *hexaglide, *best, **caches)
    yield "hexaglide, proofs of all sizes, d", found.cpu, 60, "CPU s"


def of_searches():
    """Searches for formulations of arms with right angles."""
    for n, limit in ((6, 5), (7, 7), (8, 10)):
        mechanism = chain(n)
        K = Dynamics(mechanism).compute_regressor(*random_states(mechanism, 500))
        W = K.reshape(-1, K.shape[2])
        base = choose_base(W, mechanism.preference_order, 1e-8)
        started = time.process_time()
        find_formulations(mechanism, find_affecting_columns(W), base.columns)
        yield f"search for formulations, {n} joints", time.process_time() - started, limit, "CPU s"


def of_proofs(folder):
    """Best subsets of up to 20 columns: of arms with seven joints, and of random columns whose neighbours are correlated."""
    path = config(folder, "arm7", serial(7))
    made = [path, "--results", folder / "arm7"]
    for stage in ("build-model", "optimize-trajectories", "sample"):
        spent(stage, *made)
    best = (
        "--set", "reduction.heuristics=[best-subset]", "--set", "selected.heuristic=best-subset",
        "--set", "reduction.stop.parameters=20",
    )  # fmt: skip
    found = spent("reduce", *made, *best)
    proofs = load_file(folder / "arm7" / "reduction.h5", Reduction, None, "reduce")[0].proofs
    what = f"best subsets of an arm of 7 joints, {proven(proofs)} of 20 sizes proven"
    yield what, found.wall, 60, "s"
    objective = TorqueObjective(problem(*drawn(80, 20, 0.5, 0)))
    effort = Effort(time_limit=60.0, jobs=os.cpu_count() or 1)
    started = time.perf_counter()
    proofs = run("best-subset", SelectionTask(objective, largest=20, effort=effort)).proofs
    seconds = time.perf_counter() - started
    yield (
        f"best subsets of 80 random columns, {proven(proofs)} of 20 sizes proven",
        seconds,
        60,
        "s",
    )


def proven(proofs):
    """How many sizes are."""
    return sum(status is ProofStatus.OPTIMAL for status in proofs.status)


def of_large_mechanisms(folder):
    """Chains and a humanoid through the stages."""
    for name, parents, limit in (
        ("chain12", serial(12), 90), ("chain20", serial(20), 90), ("chain30", serial(30), 90),
        ("humanoid32", branches(), 60),
    ):  # fmt: skip
        path = config(folder, name, parents)
        found = spent("build-model", path, "--results", folder / name)
        yield f"build-model of {name}", found.cpu, limit, "CPU s"
        yield f"build-model of {name}", found.memory, 1000, "MB"
    made = [folder / "chain30.yaml", "--results", folder / "chain30"]
    both = spent("optimize-trajectories", *made, "--jobs", 1)
    yield "a trajectory of 30 joints", both.cpu / 2, 60, "CPU s"
    yield "sample of 1,000 states, 30 joints", spent("sample", *made).cpu, 5, "CPU s"
    yield "forward selection of every n, 30 joints", spent("reduce", *made).cpu, 10, "CPU s"


def main():
    title = "Whole commands; memory is that of the largest process"
    table = rich.table.Table("what", "took", "at most", "", title=title, box=rich.box.SIMPLE)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for what, took, limit, unit in itertools.chain(
            of_the_shell(folder),
            of_searches(),
            of_proofs(folder),
            of_large_mechanisms(folder),
            of_papers_systems(folder),
        ):
            row = (
                what,
                f"{took:.3g} {unit}",
                f"{limit} {unit}",
                "reached" if took <= limit else "MISSED",
            )
            print(*row, sep=" | ", flush=True)
            table.add_row(*row)
    rich.console.Console(width=110).print(table)


if __name__ == "__main__":
    main()
