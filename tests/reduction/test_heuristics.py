from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.selection import (
    all_best_errors,
    error_by_definition,
    floating_forward,
    forward_two_passes,
)
from selecting import dependent_problem, order, problem, subsets

from paramreduce_cli.reduction.fitting import fit
from paramreduce_cli.reduction.heuristics import heuristics


@pytest.mark.parametrize("name", list(heuristics))
@pytest.mark.parametrize("seed", range(3))
def test_every_heuristic_finds_a_subset_of_every_size_and_full_precision_at_the_rank(name, seed):
    p = dependent_problem(seed)
    found = subsets(name, p)
    assert list(found) == list(range(1, 13))
    assert all(len(set(s)) == n and set(s) <= set(range(12)) for n, s in found.items())
    assert error_by_definition(p.W, p.chi, found[8]) < 1e-12


@pytest.mark.parametrize("name", list(heuristics))
def test_candidates_alone_are_chosen_and_sizes_are_limited(name):
    whole = dependent_problem(0)
    p = problem(whole.W, whole.chi, candidates=[1, 4, 7])
    found = subsets(name, p)
    assert list(found) == [1, 2, 3]
    assert set(found[3]) == {1, 4, 7}
    assert max(subsets(name, whole, largest=5)) == 5


@pytest.mark.parametrize("name", list(heuristics))
@pytest.mark.parametrize("factor", [2.0**-20, 2.0**20])  # no rounding
def test_units_of_the_torques_do_not_matter(name, factor):
    p = dependent_problem(1)
    scaled = problem(p.W * factor, p.chi * factor)
    one, two = subsets(name, p), subsets(name, scaled)
    assert all(set(one[n]) == set(two[n]) for n in range(1, 8))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(
    ("name", "algorithm"),
    [("forward-selection-2", forward_two_passes), ("floating", floating_forward)],
)
def test_a_heuristic_is_its_algorithm_word_by_word(name, algorithm, seed):
    p = dependent_problem(seed, rank=12)
    found = subsets(name, p, largest=11)
    for n, expected in algorithm(p.W, p.chi, 11).items():
        assert set(found[n]) == set(expected)


@pytest.mark.parametrize("seed", range(4))
def test_no_exchange_improves_what_the_swap_search_finds(seed):
    p = dependent_problem(seed, rank=10, columns=14)
    for kept in list(subsets("swap", p).values())[:9]:
        error = error_by_definition(p.W, p.chi, kept)
        for out, into in product(kept, set(range(14)) - set(kept)):
            other = [into if k == out else k for k in kept]
            assert error_by_definition(p.W, p.chi, other) >= error * (1 - 1e-8)


def test_the_swap_search_leaves_a_greedy_trap():
    """Two columns that explain all together, and one that alone is better than either."""
    a, b, c, d = np.eye(6)[:, :4].T
    W = np.column_stack([a + 3 * c, b - 3 * c, a + b + 0.5 * d])
    p = problem(W, W[:, 0] + W[:, 1])
    assert 2 in subsets("forward-selection", p)[2]
    assert set(subsets("swap", p)[2]) == {0, 1}


@pytest.mark.parametrize("seed", range(5))
def test_each_forward_step_beats_every_other_candidate(seed):
    p = dependent_problem(seed)
    found = order("forward-selection", p)
    for n in range(7):
        rest = set(range(12)) - set(found[:n])
        best = min(error_by_definition(p.W, p.chi, [*found[:n], i]) for i in rest)
        assert error_by_definition(p.W, p.chi, found[: n + 1]) <= best * (1 + 1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_each_backward_step_loses_least(seed):
    p = dependent_problem(seed)
    found = order("backward-elimination", p)
    for n in range(7, 0, -1):
        kept = list(found[: n + 1])
        best = min(error_by_definition(p.W, p.chi, [k for k in kept if k != i]) for i in kept)
        assert error_by_definition(p.W, p.chi, found[:n]) <= best * (1 + 1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_each_qr_step_takes_the_most_independent_column(seed):
    p = dependent_problem(seed)
    found = order("qr", p)
    for n in range(8):
        taken = p.W[:, found[:n]]
        left = p.W - taken @ np.linalg.lstsq(taken, p.W, rcond=None)[0] if n else p.W
        lengths = np.linalg.norm(left, axis=0)
        lengths[found[:n]] = 0
        assert lengths[found[n]] >= lengths.max() * (1 - 1e-9)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", list(heuristics))
def test_no_subset_beats_exhaustive_search_and_some_equal_it(name, seed):
    p = dependent_problem(seed, rank=7, columns=7)
    found = subsets(name, p)
    always = {"forward-selection": {1}, "forward-selection-2": {1}, "backward-elimination": {6}}
    exact = always.get(name, set(range(1, 7)) if name in ("swap", "best-subset") else set())
    best = all_best_errors(p.W, p.chi)
    for n in range(1, 7):
        error = error_by_definition(p.W, p.chi, found[n])
        assert error >= best[n] * (1 - 1e-9)
        assert n not in exact or error == pytest.approx(best[n], rel=1e-8)


def twins(preference):
    """Columns 0 and 1 equal, 2 and 3 equal up to sign."""
    rng = np.random.default_rng(0)
    free = rng.normal(size=(30, 3))
    W = np.column_stack([free[:, 0], free[:, 0], free[:, 1], -free[:, 1], free[:, 2]])
    return problem(W, free @ [3.0, 2.0, 1.0], preference=preference)


@pytest.mark.parametrize("name", list(heuristics))
def test_ties_go_to_the_preferred_column(name):
    for preference, winners in (([0, 1, 2, 3, 4], {0, 2, 4}), ([1, 3, 4, 0, 2], {1, 3, 4})):
        assert set(subsets(name, twins(preference))[3]) == winners


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.integers(2, 9), st.sampled_from(list(heuristics)))
def test_errors_never_rise_with_n(seed, columns, name):
    p = dependent_problem(seed, rows=20, rank=max(1, columns - 2), columns=columns)
    errors = [fit(p, np.array(s)).torque_error for s in subsets(name, p).values()]
    assert all(b <= a + 1e-10 for a, b in pairwise(errors))
