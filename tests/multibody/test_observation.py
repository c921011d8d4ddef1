import numpy as np
import pytest
from selecting import blocks_of

from paramreduce_cli.multibody.observation import (
    combine_factors,
    compute_joint_factors,
    compute_standard_deviation,
)


@pytest.mark.parametrize("size", [1, 7, 100])
def test_factors_keep_every_least_squares_fit(size):
    rng = np.random.default_rng(0)
    data = [(rng.normal(size=(150, 6)), rng.normal(size=(50, 3))) for _ in range(2)]
    factors = compute_joint_factors(
        block for k, (W, tau) in enumerate(data) for block in blocks_of(W, tau, k, size)
    )
    weights = np.array([1.0, 3.0, 0.2])
    R = combine_factors(factors, weights)
    rows = np.tile(1 / weights, 100)
    W = np.vstack([W for W, _ in data]) * rows[:, None]
    chi = np.concatenate([tau.ravel() for _, tau in data]) * rows
    whole = np.column_stack([W, chi])
    assert np.allclose(R.T @ R, whole.T @ whole, atol=1e-10)
    assert np.allclose(np.linalg.lstsq(R[:, :-1], R[:, -1])[0], np.linalg.lstsq(W, chi)[0])


def test_factors_of_one_joint_and_trajectory():
    rng = np.random.default_rng(1)
    W, tau = rng.normal(size=(60, 4)), rng.normal(size=(20, 3))
    factors = compute_joint_factors(blocks_of(W, tau, 0, 6))
    own = np.column_stack([W[1::3], tau[:, 1]])
    assert np.allclose(factors[0, 1].T @ factors[0, 1], own.T @ own, atol=1e-12)


def test_standard_deviation_in_pieces():
    rng = np.random.default_rng(2)
    data = rng.normal(loc=1e6, size=(1000, 3))
    pieces = np.split(data, [3, 10, 500])
    assert compute_standard_deviation(pieces) == pytest.approx(data.std(axis=0), rel=1e-8)
