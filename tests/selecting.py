"""Run heuristics on small least-squares problems."""

import numpy as np

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
    return SelectionProblem(
        W,
        chi,
        columns if candidates is None else np.asarray(candidates),
        columns if preference is None else np.asarray(preference),
        tuple(np.asarray(g) for g in groups),
    )


__all__ = ["Effort", "found", "order", "problem", "subsets"]
