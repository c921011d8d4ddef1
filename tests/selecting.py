"""Run heuristics on small least-squares problems."""

import numpy as np

from paramreduce_cli.records import Block
from paramreduce_cli.reduction.criteria.torque import TorqueObjective
from paramreduce_cli.reduction.heuristics import heuristics
from paramreduce_cli.reduction.problem import SelectionProblem
from paramreduce_cli.reduction.task import Effort, SelectionTask


def found(name, problem, **task):
    return heuristics[name](SelectionTask(TorqueObjective(problem), **task))


def subsets(name, problem, **task):
    """Columns by their number, in the order in which they were taken."""
    return {s.size: s.tolist() for s in found(name, problem, **task).subsets}


def order(name, problem):
    return np.array(list(subsets(name, problem).values())[-1])


def problem(W, chi, groups=(), preference=None, candidates=None):
    columns = np.arange(W.shape[1])
    chosen, wanted = (columns if x is None else np.asarray(x) for x in (candidates, preference))
    return SelectionProblem(W, chi, chosen, wanted, tuple(map(np.asarray, groups)))


def dependent_problem(seed, rows=60, rank=8, columns=12, **changes):
    """Columns of some rank; the torques are not reached by any proper subset of that size."""
    rng = np.random.default_rng(seed)
    W = rng.normal(size=(rows, rank)) @ rng.normal(size=(rank, columns))
    return problem(W, W @ rng.normal(size=columns), **changes)


def blocks_of(W, tau, trajectory, size):
    """Samples in blocks of some size, without states."""
    n_dof = tau.shape[1]
    for start in range(0, len(tau), size):
        part, rows = tau[start : start + size], W[start * n_dof : (start + size) * n_dof]
        states = [np.zeros_like(part)] * 3
        yield Block(trajectory, states[0][:, 0], *states, part, *states, rows)


__all__ = ["Effort", "blocks_of", "dependent_problem", "found", "order", "problem", "subsets"]
