"""Proofs of one size beside general mixed-integer solvers and exhaustive regression, at equal CPU time.

`python -m tests.benchmarks.proof_peers` with gurobipy (its restricted licence is enough), pyscipopt, and R with its package
leaps; what is not there is left out. Every peer is given one size at a time, ours all sizes up to it at once.
"""

import importlib.util
import os
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import rich.box
import rich.console
import rich.table

from paramreduce_cli.reduction.criteria.torque import TorqueObjective
from paramreduce_cli.reduction.task import Effort, SelectionTask, run
from tests.benchmarks.random_columns import drawn
from tests.selecting import problem

SECONDS, JOBS = 60.0, os.cpu_count() or 1
COLUMNS, SIZE = 80, 20
CASES = ((10, 0.5, 0), (20, 0.9, 0), (40, 0.5, 0))
"""Columns with an effect, correlation of neighbours, seed."""
BOUND = 2.0
"""Solvers are told that no coefficient is larger than the largest of the full fit times this, in the manner of Bertsimas, King
and Mazumder (2016)."""


class Fit:
    """Least squares of unit columns: squared error of coefficients b is c - 2 g b + b G b."""

    def __init__(self, W, chi):
        self.X, self.y = W / np.linalg.norm(W, axis=0), chi / np.linalg.norm(chi)
        self.G, self.g = self.X.T @ self.X, self.X.T @ self.y
        self.largest = BOUND * np.abs(np.linalg.lstsq(self.X, self.y)[0]).max()

    def error(self, subset):
        """Relative error of the fit of some columns."""
        X = self.X[:, subset]
        return float(np.linalg.norm(self.y - X @ np.linalg.lstsq(X, self.y)[0]))


def ours(fit, n):
    """All sizes up to n."""
    effort = Effort(time_limit=SECONDS, jobs=JOBS)
    task = SelectionTask(TorqueObjective(problem(fit.X, fit.y)), largest=n, effort=effort)
    proofs = run("best-subset", task).proofs
    k = list(proofs.n).index(n)
    return float(proofs.torque_error[k]), float(proofs.lower_bound[k])


def gurobi(fit, n):
    """Quadratic objective, coefficients bounded by binaries, as many of these as there are places."""
    import gurobipy as gp

    with gp.Env(params={"OutputFlag": 0}) as env, gp.Model(env=env) as model:
        model.Params.TimeLimit, model.Params.Threads, model.Params.MIPGap = SECONDS, JOBS, 1e-9
        b = model.addMVar(COLUMNS, lb=-fit.largest, ub=fit.largest)
        z = model.addMVar(COLUMNS, vtype="B")
        model.addConstr(b <= fit.largest * z)
        model.addConstr(b >= -fit.largest * z)
        model.addConstr(z.sum() <= n)
        model.setObjective(b @ fit.G @ b - 2 * fit.g @ b + 1.0)
        model.optimize()
        return fit.error(np.flatnonzero(z.X > 0.5)), max(model.ObjBound, 0.0) ** 0.5


def scip(fit, n):
    """The same with the norm of what is left over of the triangular factor as a cone; on one core, so for longer."""
    import pyscipopt

    model = pyscipopt.Model()
    model.hideOutput()
    model.setParams({"limits/time": JOBS * SECONDS, "limits/gap": 1e-9})
    b = [model.addVar(lb=-fit.largest, ub=fit.largest) for _ in range(COLUMNS)]
    z = [model.addVar(vtype="B") for _ in range(COLUMNS)]
    for one, used in zip(b, z, strict=True):
        model.addCons(one <= fit.largest * used)
        model.addCons(one >= -fit.largest * used)
    model.addCons(pyscipopt.quicksum(z) <= n)
    triangle = np.linalg.qr(np.column_stack([fit.X, fit.y]), mode="r")
    rest = [model.addVar(lb=None) for _ in triangle]
    for left, row in zip(rest, triangle, strict=True):
        explained = pyscipopt.quicksum(float(w) * one for w, one in zip(row, b, strict=False))
        model.addCons(left == float(row[-1]) - explained)
    square = model.addVar(lb=0)
    model.addCons(pyscipopt.quicksum(one * one for one in rest) <= square)
    model.setObjective(square)
    model.optimize()
    used = [k for k, one in enumerate(z) if model.getVal(one) > 0.5]
    return fit.error(used), max(model.getDualbound(), 0.0) ** 0.5


LEAPS = """
library(leaps)
data <- as.matrix(read.csv("data.csv", header = FALSE)); n <- as.integer(commandArgs(TRUE)[1]); p <- ncol(data) - 1
found <- regsubsets(data[, 1:p], data[, p + 1], nvmax = n, nbest = 1, intercept = FALSE, method = "exhaustive", really.big = TRUE)
cat(which(summary(found)$which[n, ]) - 1)
"""


def leaps(fit, n):
    """Furnival and Wilson's leaps and bounds, on one core: nothing is known of it before it ends."""
    with tempfile.TemporaryDirectory() as name:
        np.savetxt(Path(name) / "data.csv", np.column_stack([fit.X, fit.y]), delimiter=",")
        command = ["Rscript", "-e", LEAPS, str(n)]
        try:
            done = subprocess.run(command, cwd=name, timeout=JOBS * SECONDS, check=True, capture_output=True)  # fmt: skip
        except subprocess.TimeoutExpired:
            return np.nan, 0.0
    error = fit.error([int(k) for k in done.stdout.split()])
    return error, error


def solvers():
    """What is there, ours first."""
    yield "best-subset, all n up to this", ours
    if importlib.util.find_spec("gurobipy"):
        yield "Gurobi", gurobi
    if importlib.util.find_spec("pyscipopt"):
        yield "SCIP", scip
    if shutil.which("Rscript"):
        yield "leaps (R)", leaps


def main():
    ours(Fit(*drawn(COLUMNS, 2, 0.0, 1)), 2)  # compile
    headings = ("with an effect", "correlation", "by", "s", "error, %", "bound, %", "gap, %")
    table = rich.table.Table(*headings, box=rich.box.MARKDOWN)
    for effects, correlation, seed in CASES:
        fit = Fit(*drawn(COLUMNS, effects, correlation, seed))
        for name, solve in solvers():
            started = time.perf_counter()
            error, bound = solve(fit, SIZE)
            seconds = time.perf_counter() - started
            told = ("-", "-", "-")
            if np.isfinite(error):
                bound = min(bound, error)
                told = (
                    f"{100 * error:.4f}",
                    f"{100 * bound:.4f}",
                    f"{100 * (1 - bound / error):.2g}",
                )
            cells = (str(effects), str(correlation), name, f"{seconds:.0f}", *told)
            print(*cells, sep=" | ", flush=True)
            table.add_row(*cells)
    rich.console.Console(width=130).print(table)


if __name__ == "__main__":
    main()
