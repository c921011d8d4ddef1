import numpy as np
import pytest

from paramreduce_cli.judgement.torque import torque_errors
from paramreduce_cli.records import Block
from paramreduce_cli.reduction.fitting import fit
from paramreduce_cli.reduction.problem import SelectionProblem


def example(seed=0, rank=5, columns=8):
    rng = np.random.default_rng(seed)
    W = rng.normal(size=(30, rank)) @ rng.normal(size=(rank, columns))
    phi = rng.normal(size=columns)
    return SelectionProblem(W, W @ phi, np.arange(columns), np.arange(columns)), phi


def test_approximate_base_parameters_follow_from_beta():
    p, phi = example(rank=8)
    kept = np.array([4, 1, 6])
    others = np.array([0, 2, 3, 5, 7])
    found = fit(p, kept)
    assert found.beta.shape == (3, 5)
    assert found.parameters == pytest.approx(phi[kept] + found.beta @ phi[others])
    assert found.beta == pytest.approx(np.linalg.pinv(p.W[:, kept]) @ p.W[:, others])


def test_beyond_the_rank_the_fit_is_exact_and_flagged():
    p, _ = example()
    assert not fit(p, np.arange(5)).minimum_norm
    found = fit(p, np.arange(7))
    assert found.minimum_norm
    assert found.torque_error < 1e-12
    # The smallest of all solutions, each parameter measured by the torques it causes.
    lengths = np.linalg.norm(p.W[:, :7], axis=0)
    expected = np.linalg.pinv(p.W[:, :7] / lengths) @ p.chi
    assert found.parameters * lengths == pytest.approx(expected)


def test_norms_by_their_definitions():
    rng = np.random.default_rng(1)
    W, tau, weights = rng.normal(size=(60, 4)), rng.normal(size=(20, 3)), np.array([1, 5, 0.3])
    models = rng.normal(size=(4, 2))
    states = np.zeros((20, 3))
    blocks = [
        Block(
            0,
            states[k : k + 7, 0],
            *[states[k : k + 7]] * 3,
            tau[k : k + 7],
            *[states[k : k + 7]] * 3,
            W[3 * k : 3 * k + 21],
        )
        for k in range(0, 20, 7)
    ]
    found = torque_errors(blocks, models, weights)
    rows = np.tile(weights, 20)
    chi = tau.ravel() / rows
    for m in range(2):
        left = chi - W @ models[:, m] / rows
        for value, order in ((found.one, 1), (found.two, 2), (found.infinity, np.inf)):
            expected = np.linalg.norm(left, order) / np.linalg.norm(chi, order)
            assert value[m] == pytest.approx(expected)
        for j in range(3):
            expected = np.linalg.norm(left[j::3]) / np.linalg.norm(chi[j::3])
            assert found.joints[m, j] == pytest.approx(expected)
