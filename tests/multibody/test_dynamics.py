import numpy as np
import pytest
from conftest import branching_tree, puma_mechanism, random_states, standard_arm, whole
from oracles import lagrange

from paramreduce_cli.multibody.dynamics import Dynamics


def relative(found, expected):
    return np.abs(found - expected).max() / np.abs(expected).max()


def random_parameters(mechanism, seed):
    rng = np.random.default_rng(seed)
    phi = rng.uniform(-1, 1, size=10 * mechanism.n_dof)
    phi[::10] = rng.uniform(0.5, 3, size=mechanism.n_dof)  # Pinocchio divides by the mass
    return phi


@pytest.mark.parametrize("seed", range(3))
def test_inverse_dynamics_agrees_with_pinocchio(mechanism, seed):
    oracle = pytest.importorskip("oracles.pinocchio_model", reason="Pinocchio is not installed")
    phi = random_parameters(mechanism, seed)
    states = random_states(mechanism, 50, seed)
    found = Dynamics(mechanism).inverse(*states, phi)
    assert relative(found, oracle.inverse_dynamics(mechanism, phi, *states)) < 1e-12


@pytest.mark.parametrize("seed", range(3))
def test_mass_matrix_and_bias_agree_with_pinocchio(mechanism, seed):
    oracle = pytest.importorskip("oracles.pinocchio_model", reason="Pinocchio is not installed")
    phi = random_parameters(mechanism, seed)
    z, dz, _ = random_states(mechanism, 50, seed)
    M_map, bias_map = Dynamics(mechanism).direct_regressor(z, dz)
    M, bias = oracle.mass_matrix_and_bias(mechanism, phi, z, dz)
    assert relative(M_map @ phi, M) < 1e-12
    assert relative(bias_map @ phi, bias) < 1e-12


@pytest.mark.parametrize("make", [puma_mechanism, branching_tree])
def test_observation_matrix_agrees_with_pinocchio(make):
    oracle = pytest.importorskip("oracles.pinocchio_model", reason="Pinocchio is not installed")
    mechanism = make()
    states = random_states(mechanism, 50)
    found = Dynamics(mechanism).regressor(*states)
    assert relative(found, oracle.regressor(mechanism, *states)) < 1e-12


@pytest.mark.parametrize("make", [branching_tree, standard_arm])
def test_inverse_dynamics_agrees_with_lagrange(make):
    mechanism = make()
    oracle = lagrange.inverse_dynamics(mechanism)
    phi = random_parameters(mechanism, 7)
    states = random_states(mechanism, 10)
    expected = np.array([oracle(*state, phi) for state in zip(*states, strict=True)])
    assert relative(Dynamics(mechanism).inverse(*states, phi), expected) < 1e-12


def test_inverse_and_direct_dynamics_are_one_model(mechanism):
    dynamics = Dynamics(mechanism)
    phi = random_parameters(mechanism, 1)
    z, dz, ddz = random_states(mechanism, 20)
    M_map, bias_map = dynamics.direct_regressor(z, dz)
    together = np.einsum("kij,kj->ki", M_map @ phi, ddz) + bias_map @ phi
    assert relative(together, dynamics.inverse(z, dz, ddz, phi)) < 1e-12


def test_adjoint_is_the_derivative_of_the_observation_matrix(mechanism):
    columns = np.arange(10, 10 * mechanism.n_dof)
    observation = Dynamics(mechanism).observation(columns)
    states = random_states(mechanism, 4)
    rng = np.random.default_rng(3)
    seed = rng.normal(size=observation.forward(*states).shape)
    gradients = observation.adjoint(*states, seed)
    step = 1e-6
    for which, gradient in enumerate(gradients):
        direction = rng.normal(size=gradient.shape)
        values = []
        for sign in (1, -1):
            moved = [s + sign * step * direction * (k == which) for k, s in enumerate(states)]
            values.append(np.sum(observation.forward(*moved) * seed))
        slope = (values[0] - values[1]) / (2 * step)
        assert slope == pytest.approx(np.sum(gradient * direction), rel=1e-6, abs=1e-6)


def test_operation_counts_of_plain_recursion_on_the_puma():
    dynamics = Dynamics(puma_mechanism())
    z, dz, ddz = random_states(dynamics.mechanism, 50)
    W = dynamics.regressor(z, dz, ddz).reshape(-1, 60)
    affecting = np.flatnonzero(np.linalg.norm(W, axis=0) > 1e-10)
    assert affecting.size == 49
    # [Ros2019] counts 719 and 1658 by its rule, without sharing of what is equal up to its sign.
    assert dynamics.count_operations(whole(dynamics.mechanism, affecting)) == (661, 1304)


def test_dropping_parameters_never_costs_operations():
    dynamics = Dynamics(puma_mechanism())
    rng = np.random.default_rng(0)
    kept = np.arange(60)
    last = dynamics.count_operations(whole(dynamics.mechanism, kept))
    while kept.size:
        kept = np.sort(rng.permutation(kept)[:-6])
        count = dynamics.count_operations(whole(dynamics.mechanism, kept))
        assert count[0] <= last[0]
        assert count[1] <= last[1]
        last = count
    assert last == (0, 0)
