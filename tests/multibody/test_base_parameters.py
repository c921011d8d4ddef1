import numpy as np
import pytest
from conftest import branching_tree, puma_mechanism, random_states
from hypothesis import given, settings
from hypothesis import strategies as st

from paramreduce_cli.multibody.base_parameters import choose_base, find_affecting_columns
from paramreduce_cli.multibody.dynamics import Dynamics


def observation(mechanism, count=200, seed=0):
    K = Dynamics(mechanism).compute_regressor(*random_states(mechanism, count, seed))
    return K.reshape(-1, K.shape[2])


def test_puma_has_49_affecting_and_khalils_36_base_parameters():
    mechanism = puma_mechanism()
    names = mechanism.parameter_names
    W = observation(mechanism)
    base = choose_base(W, mechanism.preference_order, 1e-9)
    khalil = {"Izz_1"} | {
        f"{kind}_{body}"
        for kind in ("Izz", "Ixx", "Ixy", "Ixz", "Iyz", "mx", "my")
        for body in range(2, 7)
    }
    assert find_affecting_columns(W).sum() == 49
    assert {names[k] for k in base.columns} == khalil
    assert base.rank_gap > 1e10


def test_rank_is_that_of_a_singular_value_decomposition():
    W = observation(branching_tree())
    W = W[:, find_affecting_columns(W)]
    expected = np.linalg.matrix_rank(W / np.linalg.norm(W, axis=0), tol=1e-8)
    base = choose_base(W, np.arange(W.shape[1]), 1e-9)
    assert base.columns.size == expected


def test_beta_reproduces_all_columns(mechanism):
    W = observation(mechanism)
    base = choose_base(W, mechanism.preference_order, 1e-9)
    others = np.setdiff1d(np.arange(W.shape[1]), base.columns)
    assert base.beta.shape == (base.columns.size, others.size)
    assert np.abs(W[:, others] - W[:, base.columns] @ base.beta).max() < 1e-11 * np.abs(W).max()


@pytest.mark.parametrize("factor", [1e-9, 1e9])
def test_rank_does_not_depend_on_units(factor):
    W = observation(puma_mechanism())
    assert choose_base(W * factor, np.arange(60), 1e-9).columns.size == 36


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 8), st.integers(0, 5))
def test_random_matrices_of_known_rank(seed, rank, extra):
    rng = np.random.default_rng(seed)
    independent = rng.normal(size=(40, rank))
    dependent = independent @ rng.normal(size=(rank, extra))
    W = np.column_stack([independent, dependent, np.zeros(40)])
    W = W[:, rng.permutation(W.shape[1])] * 10.0 ** rng.uniform(-3, 3, size=W.shape[1])
    base = choose_base(W, np.arange(W.shape[1]), 1e-10)
    assert base.columns.size == rank
