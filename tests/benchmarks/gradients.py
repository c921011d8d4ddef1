"""One descent through IPOPT with exact gradients against finite differences, in CPU time."""

import time

import numpy as np
import scipy.linalg

from paramreduce_cli.excitation.excitation_objective import FreeObjective
from paramreduce_cli.excitation.ipopt import minimise
from paramreduce_cli.excitation.limits import LimitMap
from paramreduce_cli.excitation.optimiser import FREE
from paramreduce_cli.excitation.workers import build_excitation
from paramreduce_cli.multibody.loops.follower import Follower
from paramreduce_cli.stages.optimize_trajectories import make_task
from tests.conftest import config_and_model


class Differences:
    """The same objective with forward differences for its gradient, and values without adjoints."""

    def __init__(self, excitation, basis, limits, level):
        self._excitation, self._basis = excitation, basis
        self._limits, self._level = limits, level

    def value(self, x):
        coefficients, _ = self._limits.map_to_admissible(x.reshape(6, 9), self._level.limits)
        W = self._excitation.weigh_rows(*self._basis.evaluate(coefficients))
        scaled, _ = self._excitation.scaling(W, self._excitation.beta, self._level.maxima)
        eigenvalues = scipy.linalg.eigvalsh(scaled.T @ scaled, check_finite=False)
        return self._excitation.criterion(eigenvalues, self._level.sharpness)[0]

    def __call__(self, x):
        value = self.value(x)
        steps = 1e-7 * np.eye(x.size)
        return value, np.array([(self.value(x + step) - value) / 1e-7 for step in steps])


def descend(make, start):
    started = time.process_time()
    x, curvature = start, None
    for step in FREE.steps[:2]:
        end = minimise(make(step.level), x, 100, curvature)
        x, curvature = end.x, end.curvature
    return time.process_time() - started, end.value


def rows():
    config, model = config_and_model("puma560")
    task = make_task(config.trajectories, model)
    excitation, settings = build_excitation(task), task.settings
    basis = settings.build_basis()
    limits = LimitMap(settings.limits, basis, "gauge")

    def objective(level):
        positions = Follower(excitation.coordinates)
        return FreeObjective(excitation, basis, limits, level, positions, np.eye(limits.n_dof))

    ratios = []
    for seed in range(3):
        start = np.random.default_rng(seed).normal(size=54)
        exact, _ = descend(objective, start)
        differences, _ = descend(lambda level: Differences(excitation, basis, limits, level), start)
        ratios.append(exact / differences)
    yield "trajectory, CPU time: exact gradients / finite differences", np.median(ratios), 1 / 8
