"""What programs are worth on random states, for programs that are known to be off by so much."""

from types import SimpleNamespace

import numpy as np
import pytest
from conftest import config_of, model_of

from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.records import Block, Constraint
from paramreduce_cli.terms.evaluation import Evaluator
from paramreduce_cli.terms.program_fitting import Budget
from paramreduce_cli.terms.tape import Outputs

OFF = np.array([0.5, -2.0])


class Moved:
    """The inverse dynamics of a tree with a constant added to every torque."""

    def __init__(self, model, off):
        self.dynamics, self.values, self.off = Dynamics(model.mechanism), model.values, off

    def evaluate(self, states):
        q, dq, ddq = np.split(states, 3)
        return Outputs.drop_zero(
            (self.dynamics.compute_torques(q.T, dq.T, ddq.T, self.values) + self.off).T
        )


def judge(robot, z, dz, ddz, nominal, constraints=(), **more):
    """Of samples with these states, in one block, and no validation set."""
    model = model_of(robot)
    coordinates = Coordinates(model.mechanism)
    q, dq, ddq = coordinates.compute_states(z, dz, ddz)
    tau = Dynamics(model.mechanism).compute_torques(q, dq, ddq, model.values)
    unused = np.zeros((z.size, model.values.size))
    block = Block(0, np.arange(len(z)), z, dz, ddz, tau, q, dq, ddq, unused)
    part = SimpleNamespace(iterate_blocks=lambda: iter([block]), n_samples=len(z))
    samples = SimpleNamespace(
        estimation=part, validation=None, nominal_acceleration=np.ones(z.shape[1])
    )
    limits = config_of(robot).trajectories.build_limits(z.shape[1])
    given = {"direct": False, "projected": False, "measured": False} | more
    return model, Evaluator(model, samples, nominal, limits, constraints, **given)


def motion(n_dof, count=300, size=0.5):
    return np.random.default_rng(3).uniform(-size, size, (3, count, n_dof))


def test_random_states_and_the_worst_of_them():
    model, judged = judge("two_link", *motion(2), np.array([20.0, 5.0]))
    found = judged.measure_deviation(Moved(model, OFF))
    assert found.states == 10_000
    np.testing.assert_allclose(found.largest, np.abs(OFF))
    assert found.worst_joint == 1, "2 of 5 is more than 0.5 of 20"
    lower, upper = judged.drawn
    np.testing.assert_allclose([lower[:2], upper[:2]], [[[-np.pi / 2] * 2, [-3] * 2], [[np.pi / 2] * 2, [3] * 2]])  # fmt: skip
    np.testing.assert_allclose([lower[2], upper[2]], [-0.5 * np.ones(2), 0.5 * np.ones(2)], atol=0.02)  # fmt: skip
    assert np.all((found.worst_state >= lower) & (found.worst_state <= upper))
    assert np.isnan(found.acceleration_error)


def test_joints_that_were_not_measured_stray_nowhere():
    model, judged = judge("two_link", *motion(2), np.array([20.0, np.inf]))
    found = judged.measure_deviation(Moved(model, OFF))
    np.testing.assert_allclose(found.largest, [0.5, np.nan])
    assert found.worst_joint == 0


@pytest.mark.parametrize("why", ["measured", "nothing is allowed"])
def test_without_random_states_differences_are_those_on_the_sets(why):
    nothing = np.zeros(3)
    far = Constraint("far", "distance-from-axis", (1, -1), (nothing, nothing, np.array([1.0, 0, 0])), 9.0, np.inf)  # fmt: skip
    constraints, measured = ([], True) if why == "measured" else ([far], False)
    nominal = np.array([20.0, 5.0])
    model, judged = judge("two_link", *motion(2), nominal, constraints, measured=measured)
    found = judged.measure_deviation(Moved(model, OFF))
    assert found.states == 0
    assert np.isnan(found.torque_error)
    np.testing.assert_allclose(found.largest, np.abs(OFF))
    assert np.all(np.abs(found.worst_state) <= 0.5)


def test_loops_that_went_around_one_way_are_looked_at_both_ways():
    time = np.linspace(0, 2, 200)[:, None]
    z, dz, ddz = 0.5 * np.sin(time) + 0.3 * time, 0.5 * np.cos(time) + 0.3, -0.5 * np.sin(time)
    assert dz.min() > 0
    _, judged = judge("rssr", z, dz, ddz, np.ones(1))
    every = np.hstack([part.states for part in judged._random_sets])
    n_q = len(every) // 3
    dependent = [k for k in range(n_q) if k not in model_of("rssr").mechanism.independent]
    velocities = every[n_q : 2 * n_q]
    assert every.shape[1] > 500
    assert np.mean(np.abs(velocities[0]) > 0.05) > 0.9, "they move"
    assert 0.3 < np.mean(velocities[0] > 0) < 0.7
    sets = judged._sets[0][0].states[n_q : 2 * n_q]
    fastest = np.abs(sets).max(axis=1)
    assert np.all(np.abs(velocities[dependent]).max(axis=1) <= fastest[dependent] * (1 + 1e-9))
    lower, upper = judged.drawn
    np.testing.assert_allclose(lower[:, 0], [every[0].min(), velocities[0].min(), every[2 * n_q].min()])  # fmt: skip
    assert upper[0, 0] > z.max() + 0.2, "positions are not those of the set alone"


def test_strain_is_the_largest_share_of_what_is_allowed():
    _, inverse = judge("two_link", *motion(2), np.ones(2))
    _, direct = judge("two_link", *motion(2), np.ones(2), direct=True)
    errors = ((0.01, 0.3), (0.5, 0.9))  # there is no validation set
    assert inverse.compute_worst_ratio(errors, Budget(0.02, 0.1)) == pytest.approx(0.5)
    assert direct.compute_worst_ratio(errors, Budget(0.02, 0.1)) == pytest.approx(3.0)
    assert direct.compute_worst_ratio(errors, Budget(0.02, np.inf)) == pytest.approx(0.5)
    assert direct.compute_worst_ratio(((0.01, np.inf), errors[1]), Budget(0.02, np.inf)) == np.inf
    assert inverse.compute_worst_ratio(((np.nan, 0.3), errors[1]), Budget(0.02, 0.1)) == np.inf
