"""How cost grows: of a chain of right-angled joints with their number, of selections with columns."""

import itertools
import time
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from paramreduce_cli.lean.formulations import find_formulations
from paramreduce_cli.multibody.base_parameters import choose_base, find_affecting_columns
from paramreduce_cli.multibody.dynamics import Dynamics
from tests.conftest import dh, mechanism_of, random_states
from tests.selecting import found, problem

JOINTS, COLUMNS = (3, 6, 12, 24), (30, 60, 120, 240)
FIGURE = Path("results/benchmark/growth.svg")
ANGLES = (0, np.pi / 2, -np.pi / 2, np.pi / 2, 0, -np.pi / 2)
STATES = 500


def chain(n):
    rows = [
        (str(k + 1), str(k) if k else None, "revolute", 0.1 * (k % 3), angle, 0.2 * (k % 2))
        for k, angle in zip(range(n), itertools.cycle(ANGLES), strict=False)
    ]
    return mechanism_of(dh(rows))


def seconds(work, times=1):
    """What it gives, and the CPU time it takes, the least of several."""
    spent = []
    for _ in range(times):
        started = time.process_time()
        result = work()
        spent.append(time.process_time() - started)
    return result, min(spent)


def of_joints(n):
    """CPU seconds by what is done with a chain of so many joints."""
    mechanism = chain(n)
    dynamics, states = Dynamics(mechanism), random_states(mechanism, STATES)
    dynamics.compute_regressor(*states)  # compiles
    K, regressor = seconds(lambda: dynamics.compute_regressor(*states), 5)
    W = K.reshape(-1, K.shape[2])
    base, ranks = seconds(lambda: choose_base(W, mechanism.preference_order, 1e-8))
    affecting = find_affecting_columns(W)
    _, searched = seconds(lambda: find_formulations(mechanism, affecting, base.columns))
    return {
        f"regressor of {STATES} states": regressor,
        "base parameters": ranks,
        "search for formulations": searched,
    }


def of_columns(n):
    """The same of selections among so many columns."""
    rng = np.random.default_rng(0)
    W = rng.normal(size=(2 * n, n)) * 10.0 ** rng.uniform(-1, 1, n)
    asked = problem(W, W @ rng.normal(size=n))
    spent = {}
    for name in ("forward-selection", "backward-elimination"):
        found(name, asked)
        spent[f"{name}, every n"] = seconds(lambda name=name: found(name, asked), 3)[1]
    return spent


def drawn(panels):
    """One panel a scale: seconds against joints, and against columns."""
    figure = Figure(figsize=(9, 3.6), layout="constrained")
    for axes, (scale, by_size) in zip(figure.subplots(1, 2), panels.items(), strict=True):
        sizes = list(by_size)
        for what in by_size[sizes[0]]:
            axes.loglog(sizes, [by_size[n][what] for n in sizes], "o-", label=what)
        first = max(by_size[sizes[0]].values())
        squares = [first * (n / sizes[0]) ** 2 for n in sizes]
        axes.loglog(sizes, squares, ":", color="0.6", label="square")
        axes.set(xlabel=scale, ylabel="CPU time, s", xticks=sizes, xticklabels=sizes)
        axes.minorticks_off()
        axes.legend(frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2)
    return figure


def rows():
    panels = {
        "joints": {n: of_joints(n) for n in JOINTS},
        "columns": {n: of_columns(n) for n in COLUMNS},
    }
    FIGURE.parent.mkdir(parents=True, exist_ok=True)
    drawn(panels).savefig(FIGURE)
    print(f"How cost grows: {FIGURE}")
    for scale, by_size in panels.items():
        *_, short, long = by_size
        square = (long / short) ** 2
        cube = (long / short) ** 3  # as rows grow as joints and columns do
        limits = {
            "base parameters": cube,
            "forward-selection, every n": cube,
            "backward-elimination, every n": 2 * cube,
        }
        for what, spent in by_size[long].items():
            ratio = spent / by_size[short][what]
            yield f"{what}, CPU time: {long} / {short} {scale}", ratio, limits.get(what, square)
