"""Subsets of the paper's systems beside those of other packages: errors and times in one table.

`PYTHONPATH=tests python -m tests.benchmarks.selection_peers`, on the committed trajectories; needs
the extra `benchmark`.
"""

import os
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

import h5py
import numpy as np
import rich.box
import rich.console
import rich.table

from paramreduce_cli.reduction.criteria.torque import TorqueObjective
from paramreduce_cli.reduction.task import Effort, SelectionTask, run
from tests.benchmarks.selection import scikit_learn
from tests.conftest import ROOT
from tests.selecting import problem

SIZES = {"puma560": (12, 18, 24), "hexaglide": (12, 15, 17, 20)}
OURS = ("forward-selection", "forward-selection-2", "floating", "backward-elimination", "swap",
        "best-subset")  # fmt: skip


STAGES = ("build-model", "optimize-trajectories", "sample", "reduce")


def problem_of(robot, folder):
    """The weighted factor of the estimation set, its columns of unit length."""
    reference = ROOT / "results" / "reference" / f"{robot}.json"
    settings = (
        f"trajectories.file={reference}",
        "reduction.heuristics=[qr]",
        "selected.heuristic=qr",
    )
    options = [word for setting in settings for word in ("--set", setting)]
    for stage in STAGES:
        command = [
            sys.executable,
            "-m",
            "paramreduce_cli",
            stage,
            ROOT / "configs" / f"{robot}.yaml",
        ]
        subprocess.run([*command, "--results", folder, *options], check=True, capture_output=True)
    with h5py.File(folder / "reduction.h5") as file:
        factor = file["factor"][:]
    W, chi = factor[:, :-1], factor[:, -1]
    lengths = np.linalg.norm(W, axis=0)
    kept = np.flatnonzero(lengths > 1e-11 * lengths.max())
    return problem(W[:, kept] / lengths[kept], chi / np.linalg.norm(chi))


def sequential_feature_selector(X, y, n):
    # Without folds its score is that of the whole matrix, as ours is.
    everything = [(np.arange(len(y)), np.arange(len(y)))]
    return np.flatnonzero(scikit_learn(X, y, everything, n).get_support())


def abess(X, y, n):
    from abess.linear import LinearRegression as Abess

    model = Abess(support_size=[n], fit_intercept=False)
    return np.flatnonzero(model.fit(X, y, is_normal=False).coef_)


def frols(X, y, n):
    """pysindy's: greedy orthogonal least squares; one run passes through every size."""
    from pysindy.optimizers import FROLS

    model = FROLS(max_iter=n, alpha=0.0, normalize_columns=False, verbose=False)
    model.fit(X, y)
    return np.flatnonzero(np.ravel(model.coef_))


PEERS = {"scikit-learn SequentialFeatureSelector": sequential_feature_selector, "abess": abess,
         "FROLS (pysindy)": frols}  # fmt: skip


def main():
    warnings.simplefilter("ignore")
    headings = ("system", "method", "time, all sizes", "torque error, %", "sizes")
    table = rich.table.Table(*headings, box=rich.box.MARKDOWN)
    for robot, sizes in SIZES.items():
        with tempfile.TemporaryDirectory() as folder:
            p = problem_of(robot, Path(folder))
        objective = TorqueObjective(p)

        def error(subset, objective=objective):
            return objective.score(objective.find_groups(np.asarray(subset)))

        run("best-subset", SelectionTask(TorqueObjective(p), 2))  # compile
        reference = None
        for name in OURS:
            started = time.perf_counter()
            effort = Effort(time_limit=600, jobs=os.cpu_count() or 1)
            found = run(name, SelectionTask(TorqueObjective(p), max(sizes), effort=effort)).subsets
            seconds = time.perf_counter() - started
            reference = reference or seconds
            errors = [error(next(s for s in found if s.size == n)) for n in sizes]
            add(table, robot, name, seconds / reference, errors, sizes)
        for name, select in PEERS.items():
            errors, seconds = [], 0.0
            for n in sizes:
                started = time.perf_counter()
                subset = select(p.W, p.chi, n)
                seconds += time.perf_counter() - started
                errors.append(error(subset) if len(subset) == n else np.nan)
            add(table, robot, name, seconds / reference, errors, sizes)
    rich.console.Console(width=130).print(table)


def add(table, robot, name, ratio, errors, sizes):
    shown = ", ".join(f"{100 * e:.3f}" for e in errors)
    table.add_row(robot, name, f"{ratio:.3g}", shown, ", ".join(map(str, sizes)))


if __name__ == "__main__":
    main()
