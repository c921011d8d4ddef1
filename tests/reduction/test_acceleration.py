import numpy as np
import pytest
from conftest import branching_tree, random_states

from paramreduce_cli.judgement.acceleration_errors import compute_acceleration_errors
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.records import Block


def setup(seed=0):
    mechanism = branching_tree()
    dynamics = Dynamics(mechanism)
    rng = np.random.default_rng(seed)
    phi = np.zeros((5, 10))
    phi[:, 0], phi[:, [4, 7, 9]] = 2.0, rng.uniform(1, 2, size=(5, 3))
    phi = phi.ravel()
    z, dz, ddz = random_states(mechanism, 30, seed)
    W = dynamics.compute_regressor(z, dz, ddz).reshape(-1, 50)
    tau = (W @ phi).reshape(-1, 5)
    return dynamics, phi, [Block(0, z[:, 0], z, dz, ddz, tau, z, dz, ddz, W)]


def test_the_full_model_predicts_the_accelerations():
    dynamics, phi, blocks = setup()
    found = compute_acceleration_errors(
        blocks, dynamics.compute_mass_matrix_and_bias, phi[:, None], np.ones(5)
    )
    assert found.error[0] < 1e-10
    assert found.smallest_eigenvalue[0] > 0


def test_error_condition_and_eigenvalue_by_definition():
    dynamics, phi, blocks = setup()
    reduced = phi.copy()
    reduced[[4, 17, 29]] *= 0.9
    nominal = np.array([1.0, 2.0, 0.5, 3.0, 1.5])
    models = np.column_stack([phi, reduced])
    found = compute_acceleration_errors(
        blocks, dynamics.compute_mass_matrix_and_bias, models, nominal
    )
    (b,) = blocks
    M, delta = dynamics.compute_mass_matrix_and_bias(b.z, b.dz, reduced)
    ddz = np.linalg.solve(M, (b.tau - delta)[..., None])[..., 0]
    expected = np.linalg.norm((ddz - b.ddz) / nominal) / np.linalg.norm(b.ddz / nominal)
    assert found.error[1] == pytest.approx(expected, rel=1e-9)
    assert found.condition[1] == pytest.approx(np.linalg.cond(M).max(), rel=1e-9)
    assert found.smallest_eigenvalue[1] == pytest.approx(np.linalg.eigvalsh(M).min(), rel=1e-9)


def test_a_singular_mass_matrix_is_an_infinite_error():
    dynamics, _, blocks = setup()
    one = np.zeros((50, 1))
    one[0] = 1.0
    found = compute_acceleration_errors(
        blocks, dynamics.compute_mass_matrix_and_bias, one, np.ones(5)
    )
    assert np.isinf(found.error[0])
    assert np.isinf(found.condition[0])
