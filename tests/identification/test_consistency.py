import numpy as np
import pytest
from conftest import config_of
from simulated_logs import TWO_LINK

from paramreduce_cli.config import load_config
from paramreduce_cli.errors import DataError
from paramreduce_cli.identification.consistency import (
    compute_smallest_eigenvalues,
    fit_consistent,
    fit_unconstrained,
    list_constraints,
)
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.random_states import draw_states

pytest.importorskip("cvxpy")


def problem(robot="two_link", noise=0.0, known=1.0, seed=0):
    """Factor of data of the robot of a config, and what is known: the truth times a factor."""
    config = config_of(robot)
    mechanism = config.build_mechanism()
    truth = config.get_values()
    rng = np.random.default_rng(seed)
    W = Dynamics(mechanism, once=True).compute_regressor(*draw_states(mechanism, 200, rng))
    W = W.reshape(-1, truth.size)
    tau = W @ truth
    size = max(noise, 1e-3) * np.std(tau)
    tau = tau + noise * np.std(tau) * rng.normal(size=tau.size)
    factor = np.linalg.qr(np.column_stack([W, tau]) / size, mode="r")
    return factor, list_constraints(mechanism, known * truth, factor), truth, W


@pytest.mark.parametrize("distance", ["euclidean", "entropic"])
def test_true_parameters_are_found_where_they_are_known(distance):
    factor, physical, truth, _ = problem()
    assert np.allclose(fit_consistent(factor, physical, distance), truth, atol=1e-3)


@pytest.mark.parametrize("distance", ["euclidean", "entropic"])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_bodies_can_exist_and_fit_as_well_as_others(distance, seed):
    factor, physical, _, _ = problem(noise=0.3, known=0.5, seed=seed)
    found = fit_consistent(factor, physical, distance)
    assert np.all(compute_smallest_eigenvalues(physical, found) > 0)
    free = fit_unconstrained(factor, physical)

    def left(values):
        return np.linalg.norm(factor[:, -1] - factor[:, :-1] @ values)

    assert left(found) < 1.05 * left(free)


def test_drives_stay_positive():
    """Where data ask for negative friction, there is none."""
    factor, physical, truth, W = problem("puma560_friction", noise=0.01)
    column = int(physical.positive[1])
    asked = truth.copy()
    asked[column] = -5.0
    tau = W @ asked
    factor = np.linalg.qr(np.column_stack([W, tau]) / np.std(tau), mode="r")
    found = fit_consistent(factor, physical, "euclidean")
    assert found[physical.positive].min() >= 0
    assert found[column] < 1e-3


def test_no_entropic_distance_to_what_cannot_exist():
    factor, physical, _, _ = problem("puma560_friction")
    with pytest.raises(DataError, match="body"):
        fit_consistent(factor, physical, "entropic")


def test_nothing_known_is_no_obstacle():
    config = load_config(TWO_LINK)
    factor, _, _, _ = problem(noise=0.05)
    physical = list_constraints(config.build_mechanism(), np.zeros(20), factor)
    assert np.all(
        compute_smallest_eigenvalues(physical, fit_consistent(factor, physical, "euclidean")) > 0
    )
