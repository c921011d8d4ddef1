"""Selection by accelerations and by operations on small mechanisms, against brute force."""

from itertools import combinations

import numpy as np
import pytest
import scipy.optimize
from conftest import puma_mechanism, random_states, standard_arm
from oracles.selection import error_by_definition
from selecting import problem

from paramreduce_cli.multibody.base_parameters import find_affecting_columns
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.textbook_dynamics import PlainDynamics
from paramreduce_cli.reduction.criteria.acceleration import AccelerationObjective
from paramreduce_cli.reduction.criteria.operations import OperationsObjective
from paramreduce_cli.reduction.heuristics import heuristics
from paramreduce_cli.reduction.inputs import AccelerationData
from paramreduce_cli.reduction.task import SelectionTask


class Case:
    """A mechanism in random states, with its least-squares problem."""

    def __init__(self, mechanism, count=60, seed=0):
        rng = np.random.default_rng(seed)
        self.dynamics = Dynamics(mechanism)
        self.plain = PlainDynamics(mechanism).programs[0]
        n = self.dynamics.n_parameters
        self.phi = np.tile([4.0, 0.3, -0.2, 0.4, 0.8, 0.05, -0.04, 0.9, 0.03, 0.7], n // 10)
        self.phi = self.phi * rng.uniform(0.5, 1.5, n)
        self.q, self.dq, self.ddq = random_states(mechanism, count, seed)
        K = self.dynamics.compute_regressor(self.q, self.dq, self.ddq)
        self.tau = K @ self.phi
        W = K.reshape(-1, n)
        self.problem = problem(
            W, self.tau.ravel(), candidates=np.flatnonzero(find_affecting_columns(W))
        )
        self.A, self.B = self.dynamics.compute_mass_matrix_and_bias(self.q, self.dq, np.eye(n))
        self.nominal = self.ddq.std(axis=0)

    def objective(self):
        data = AccelerationData(self.A, self.B, self.tau, self.ddq, self.nominal)
        return AccelerationObjective(self.problem, data, data)

    def acceleration_error(self, subset, values):
        """By definition."""
        M, delta = self.A[..., subset] @ values, self.B[..., subset] @ values
        ddz = np.linalg.solve(M, (self.tau - delta)[..., None])[..., 0]
        error = np.linalg.norm((ddz - self.ddq) / self.nominal)
        return error / np.linalg.norm(self.ddq / self.nominal)

    def cost(self, kept):
        dropped = np.setdiff1d(np.arange(self.dynamics.n_parameters), kept)
        return self.plain.count(dropped.tolist())


@pytest.fixture(scope="module")
def arm():
    return Case(standard_arm())


def test_the_fit_minimises_the_exact_acceleration_error(arm):
    objective = arm.objective()
    subset = heuristics["swap"](SelectionTask(objective.cheap)).subsets[11]
    fitted = objective.fit(subset).parameters
    error = arm.acceleration_error(subset, fitted)
    assert objective.score(objective.find_groups(subset)) == pytest.approx(error, rel=1e-3)
    best = scipy.optimize.least_squares(
        lambda scale: [arm.acceleration_error(subset, fitted * scale)], np.ones(subset.size)
    )
    assert error <= best.fun[0] * (1 + 2e-3)
    assert error < arm.acceleration_error(subset, objective.cheap.fit(subset).parameters)


def test_accelerations_choose_better_subsets_than_torques(arm):
    objective = arm.objective()
    own = {s.size: s for s in heuristics["swap"](SelectionTask(objective, 12)).subsets}
    torque = {s.size: s for s in heuristics["swap"](SelectionTask(objective.cheap, 12)).subsets}
    better = 0
    for n in range(8, 13):
        one, two = (objective.score(objective.find_groups(s[n])) for s in (own, torque))
        assert one <= two * (1 + 1e-9)
        better += one < two * 0.999
    assert better > 0


@pytest.mark.parametrize("name", ["forward-selection", "floating", "backward-elimination"])
def test_other_heuristics_run_by_acceleration(arm, name):
    objective = arm.objective()
    found = heuristics[name](SelectionTask(objective)).subsets
    assert [s.size for s in found] == list(range(1, arm.problem.candidates.size + 1))
    assert all(np.unique(s).size == s.size for s in found)
    exact = next(s for s in found if objective.score(objective.find_groups(s)) < 1e-6)
    assert arm.acceleration_error(exact, objective.fit(exact).parameters) < 1e-6


def test_the_exact_fit_survives_a_reduced_mass_matrix_that_is_singular(arm):
    objective = arm.objective()
    light = objective.score((objective.find_groups(np.array([arm.problem.candidates[0]]))[0],))
    assert light > 1


@pytest.mark.parametrize("limit", [0.03, 0.1])
def test_the_fewest_operations_under_a_limit_are_those_of_exhaustive_search(limit):
    """On few columns of a real arm, the others being left out of the problem."""
    case = Case(puma_mechanism(), count=40)
    names = case.dynamics.mechanism.parameter_names
    few = "m_3 m_4 mx_2 mx_3 mz_4 Izz_2 Izz_3 Ixx_3 Iyy_3 Iyy_4 Izz_1 my_3"
    few = [names.index(name) for name in few.split()]
    W = case.problem.W
    chi = W[:, few] @ case.phi[few]
    p = problem(W, chi, candidates=few)
    best = min(
        case.cost(np.sort(subset))
        for n in range(1, 11)
        for subset in map(np.array, combinations(few, n))
        if error_by_definition(W, chi, subset) <= limit
    )
    subsets = heuristics["swap"](SelectionTask(OperationsObjective(p, case.cost, limit))).subsets
    kept = [np.sort(s) for s in subsets if error_by_definition(W, chi, s) <= limit]
    assert min(map(case.cost, kept)) <= best * 1.05  # a local search proves nothing


@pytest.mark.parametrize("name", ["forward-selection", "floating", "backward-elimination"])
def test_other_heuristics_run_by_operations(arm, name):
    objective = OperationsObjective(arm.problem, arm.cost, 0.02)
    found = heuristics[name](SelectionTask(objective)).subsets
    assert all(np.unique(s).size == s.size for s in found)
    within = [s for s in found if error_by_definition(arm.problem.W, arm.problem.chi, s) <= 0.02]
    assert within
    assert found[-1].size <= objective.largest
