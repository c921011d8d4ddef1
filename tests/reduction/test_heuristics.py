from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.selection import best_subset_error, error_by_definition

from paramreduce_cli import registry
from paramreduce_cli.reduction.fitting import fit
from paramreduce_cli.reduction.problem import SelectionProblem


def problem(seed, rows=60, rank=8, columns=12, preference=None):
    """Four dependent columns; the torques are not reached by any proper subset."""
    rng = np.random.default_rng(seed)
    W = rng.normal(size=(rows, rank)) @ rng.normal(size=(rank, columns))
    chi = W @ rng.normal(size=columns)
    order = np.arange(columns) if preference is None else np.asarray(preference)
    return SelectionProblem(W, chi, np.arange(columns), order)


@pytest.mark.parametrize("name", list(registry.heuristic))
@pytest.mark.parametrize("seed", range(3))
def test_every_heuristic_orders_all_candidates_once(name, seed):
    p = problem(seed)
    order = registry.heuristic[name](p)
    assert sorted(order) == list(p.candidates)


@pytest.mark.parametrize("name", list(registry.heuristic))
@pytest.mark.parametrize("seed", range(3))
def test_full_precision_at_the_rank(name, seed):
    p = problem(seed)
    order = registry.heuristic[name](p)
    assert error_by_definition(p.W, p.chi, order[:8]) < 1e-12


@pytest.mark.parametrize("name", list(registry.heuristic))
def test_candidates_alone_are_ordered(name):
    p = problem(0)
    p = SelectionProblem(p.W, p.chi, np.array([1, 4, 7]), p.preference)
    assert sorted(registry.heuristic[name](p)) == [1, 4, 7]


@pytest.mark.parametrize("name", list(registry.heuristic))
@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_units_of_the_torques_do_not_matter(name, factor):
    p = problem(1)
    scaled = SelectionProblem(p.W * factor, p.chi * factor, p.candidates, p.preference)
    assert np.array_equal(registry.heuristic[name](p), registry.heuristic[name](scaled))


@pytest.mark.parametrize("seed", range(5))
def test_each_forward_step_beats_every_other_candidate(seed):
    p = problem(seed)
    order = registry.heuristic["forward-selection"](p)
    for n in range(7):
        rest = set(range(12)) - set(order[:n])
        best = min(error_by_definition(p.W, p.chi, [*order[:n], i]) for i in rest)
        assert error_by_definition(p.W, p.chi, order[: n + 1]) <= best * (1 + 1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_each_backward_step_loses_least(seed):
    p = problem(seed)
    order = registry.heuristic["backward-elimination"](p)
    for n in range(7, 0, -1):
        kept = list(order[: n + 1])
        best = min(error_by_definition(p.W, p.chi, [k for k in kept if k != i]) for i in kept)
        assert error_by_definition(p.W, p.chi, order[:n]) <= best * (1 + 1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_each_qr_step_takes_the_most_independent_column(seed):
    p = problem(seed)
    order = registry.heuristic["qr"](p)
    for n in range(8):
        taken = p.W[:, order[:n]]
        left = p.W - taken @ np.linalg.lstsq(taken, p.W, rcond=None)[0] if n else p.W
        lengths = np.linalg.norm(left, axis=0)
        lengths[order[:n]] = 0
        assert lengths[order[n]] >= lengths.max() * (1 - 1e-9)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", list(registry.heuristic))
def test_no_subset_beats_exhaustive_search_and_the_last_steps_equal_it(name, seed):
    p = problem(seed, rank=7, columns=7)
    order = registry.heuristic[name](p)
    for n in range(1, 7):
        best = best_subset_error(p.W, p.chi, n)
        assert error_by_definition(p.W, p.chi, order[:n]) >= best * (1 - 1e-9)
    if name == "forward-selection":
        assert error_by_definition(p.W, p.chi, order[:1]) == pytest.approx(
            best_subset_error(p.W, p.chi, 1)
        )
    if name == "backward-elimination":
        assert error_by_definition(p.W, p.chi, order[:6]) == pytest.approx(
            best_subset_error(p.W, p.chi, 6)
        )


def twins(preference):
    """Columns 0 and 1 equal, 2 and 3 equal up to sign."""
    rng = np.random.default_rng(0)
    free = rng.normal(size=(30, 3))
    W = np.column_stack([free[:, 0], free[:, 0], free[:, 1], -free[:, 1], free[:, 2]])
    chi = free @ [3.0, 2.0, 1.0]
    return SelectionProblem(W, chi, np.arange(5), np.asarray(preference))


@pytest.mark.parametrize("name", list(registry.heuristic))
def test_ties_go_to_the_preferred_column(name):
    for preference, winners in (([0, 1, 2, 3, 4], {0, 2, 4}), ([1, 3, 4, 0, 2], {1, 3, 4})):
        order = registry.heuristic[name](twins(preference))
        assert set(order[:3].tolist()) == winners


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.integers(2, 9), st.sampled_from(list(registry.heuristic)))
def test_errors_never_rise_with_n(seed, columns, name):
    p = problem(seed, rows=20, rank=max(1, columns - 2), columns=columns)
    order = registry.heuristic[name](p)
    errors = [fit(p, order[:n]).torque_error for n in range(1, columns + 1)]
    assert all(b <= a + 1e-10 for a, b in pairwise(errors))
