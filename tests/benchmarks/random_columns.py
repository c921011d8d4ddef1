"""Proofs on random columns whose neighbours are correlated: which of n <= 20 of 80 are proven in a minute on all cores.

`python -m tests.benchmarks.random_columns`; three rows a column, noise of 0.45 of the signal. How hard a draw is depends on how
many columns have an effect: where they are more than n, many subsets are nearly as good as the best. Others:
`--columns 120 --effects 30 --largest 60 --seconds 150 --seeds 1`.
"""

import argparse
import itertools
import os
import time

import numpy as np
import rich.box
import rich.console
import rich.table

from paramreduce_cli.records import ProofStatus
from paramreduce_cli.reduction.criteria.torque import TorqueObjective
from paramreduce_cli.reduction.task import Effort, SelectionTask, run
from tests.selecting import problem

NOISE, CORRELATIONS = 0.45, (0.5, 0.9)


def autoregressive(rng, rows, columns, correlation):
    """Columns as of an autoregressive process of first order."""
    W = rng.normal(size=(rows, columns))
    for j in range(1, columns):
        W[:, j] = correlation * W[:, j - 1] + np.sqrt(1 - correlation**2) * W[:, j]
    return W


def drawn(columns, effects, correlation, seed):
    """Correlated columns, and what some of them explain, with noise."""
    rng = np.random.default_rng(seed)
    W = autoregressive(rng, 3 * columns, columns, correlation)
    signal = W[:, rng.choice(columns, effects, replace=False)] @ rng.normal(size=effects)
    noise = rng.normal(size=3 * columns)
    return W, signal + NOISE * np.linalg.norm(signal) / np.linalg.norm(noise) * noise


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--columns", type=int, default=80)
    parser.add_argument("--effects", type=int, nargs="+", default=[10, 20, 40])
    parser.add_argument("--largest", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seeds", type=int, default=3)
    given = parser.parse_args()
    effort = Effort(time_limit=given.seconds, jobs=os.cpu_count() or 1)
    small = problem(*drawn(20, 10, 0.5, 9))
    run("best-subset", SelectionTask(TorqueObjective(small), largest=2))  # compile
    headings = (
        "with an effect",
        "correlation",
        "seed",
        f"proven of {given.largest}",
        "s",
        "largest gap of the rest, %",
    )
    table = rich.table.Table(*headings, box=rich.box.MARKDOWN)
    for case in itertools.product(given.effects, CORRELATIONS, range(given.seeds)):
        objective = TorqueObjective(problem(*drawn(given.columns, *case)))
        started = time.perf_counter()
        proofs = run(
            "best-subset", SelectionTask(objective, largest=given.largest, effort=effort)
        ).proofs
        seconds = time.perf_counter() - started
        proven = np.array([status is ProofStatus.OPTIMAL for status in proofs.status])
        gap = (1 - proofs.lower_bound / proofs.torque_error)[~proven].max(initial=0)
        cells = [*map(str, case), str(proven.sum()), f"{seconds:.0f}", f"{100 * gap:.0f}"]
        table.add_row(*cells)
        print(cells, flush=True)
    rich.console.Console(width=110).print(table)


if __name__ == "__main__":
    main()
