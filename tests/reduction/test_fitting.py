import numpy as np
import pytest
from selecting import blocks_of, dependent_problem

from paramreduce_cli.judgement.torque_errors import compute_torque_errors
from paramreduce_cli.reduction.fitting import compute_lumping, fit


def test_approximate_base_parameters_follow_from_beta():
    p = dependent_problem(0, columns=8)
    phi = np.linalg.lstsq(p.W, p.chi)[0]
    kept = np.array([4, 1, 6])
    others = np.array([0, 2, 3, 5, 7])
    found = fit(p, kept)
    beta = compute_lumping(p.W, kept)
    assert beta.shape == (3, 5)
    assert found.parameters == pytest.approx(phi[kept] + beta @ phi[others])
    assert beta == pytest.approx(np.linalg.pinv(p.W[:, kept]) @ p.W[:, others])


def test_beyond_the_rank_the_fit_is_exact_and_flagged():
    p = dependent_problem(0, rank=5, columns=8)
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
    found = compute_torque_errors(blocks_of(W, tau, 0, 7), models, weights)
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
