"""Small symmetric matrices against numpy's."""

import numpy as np
import pytest

from paramreduce_cli.terms import matrices


@pytest.fixture
def spread():
    A = np.random.default_rng(0).normal(size=(50, 4, 6))
    return A @ np.swapaxes(A, 1, 2)


def test_inverses(spread):
    np.testing.assert_allclose(matrices.invert(spread), np.linalg.inv(spread), rtol=1e-8)
    assert matrices.is_positive_definite(spread)


@pytest.mark.parametrize("wrong", [-1e-9, 0.0, 1e-16])
def test_one_that_is_singular_or_indefinite_spoils_all(spread, wrong):
    values, vectors = np.linalg.eigh(spread[20])
    values[0] = wrong * values[-1]
    spread[20] = vectors @ np.diag(values) @ vectors.T
    assert matrices.invert(spread) is None
    assert not matrices.is_positive_definite(spread)


def test_what_is_not_a_number_is_not_positive_definite(spread):
    spread[3, 1, 1] = np.nan
    assert not matrices.is_positive_definite(spread)


def test_roots_times_vectors(spread):
    vectors = np.random.default_rng(1).normal(size=(3, 4, 50))
    weights = np.array([0.1, 2.0, 1.0, 0.5])
    found = matrices.multiply_triangles(matrices.compute_roots(spread, weights), vectors)
    forms = np.swapaxes(spread, 1, 2) @ spread + np.diag(weights**2)
    np.testing.assert_allclose(
        np.sum(found**2, axis=1), np.einsum("kis,sij,kjs->ks", vectors, forms, vectors)
    )


def test_roots_of_large_factors_keep_the_weights():
    """Of what rounding takes from their squares, Cholesky would find no root."""
    factors = 1e9 * np.ones((2, 3, 3))
    R = matrices.compute_roots(factors, np.ones(3)).transpose(2, 0, 1)
    across = np.array([1.0, -1.0, 0.0]) / np.sqrt(2)
    np.testing.assert_allclose(np.linalg.norm(R @ across, axis=1), 1.0, rtol=1e-6)


@pytest.mark.parametrize("dependent", [False, True])
def test_whitened_columns_are_orthonormal_but_for_those_that_are_made_of_others(dependent):
    columns = np.random.default_rng(2).normal(size=(5, 40)) * [[1e-3], [1], [1e3], [1], [1]]
    if dependent:
        columns[3] = 2 * columns[1] - columns[0]
        columns[4] = 0.0
    found = matrices.compute_whitening(columns @ columns.T, 1e-13) @ columns
    expected = np.eye(5) * ([1, 1, 1, 0, 0] if dependent else 1)
    np.testing.assert_allclose(found @ found.T, expected, atol=1e-5 if dependent else 1e-10)
    target = np.random.default_rng(3).normal(size=40)
    best, *_ = np.linalg.lstsq(columns.T, target, rcond=1e-9)
    np.testing.assert_allclose(
        found.T @ (found @ target), best @ columns, atol=1e-8 if dependent else 1e-10
    )
