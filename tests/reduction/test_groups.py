"""Groups: parameters that are selected together, with a value each or one for all."""

from itertools import pairwise

import numpy as np
import pytest
from oracles.selection import all_best_errors, error_by_definition
from selecting import dependent_problem, found, order, problem, subsets

from paramreduce_cli.reduction.criteria.torque import TorqueObjective
from paramreduce_cli.reduction.fitting import fit
from paramreduce_cli.reduction.grouping import Group, group_columns
from paramreduce_cli.reduction.heuristics import heuristics

GROUPS = ([0, 3, 5], [1, 7])


def grouped_problem(seed, rank=9):
    return dependent_problem(seed, rank=rank, groups=GROUPS)


@pytest.mark.parametrize("name", list(heuristics))
@pytest.mark.parametrize("seed", range(4))
def test_groups_stay_together(name, seed):
    p = grouped_problem(seed)
    chosen = subsets(name, p)
    assert set(chosen[12]) == set(range(12))
    for n, subset in chosen.items():
        assert len(set(subset)) == n
        assert all(not set(subset) & set(g) or set(g) <= set(subset) for g in GROUPS)


@pytest.mark.parametrize("seed", range(6))
def test_the_best_subset_of_groups_is_that_of_exhaustive_search(seed):
    p = grouped_problem(seed, rank=12)
    best = all_best_errors(p.W, p.chi, [u.tolist() for u in p.groups])
    proofs = found("best-subset", p).proofs
    assert set(proofs.status) == {"optimal"}
    for n, subset in zip(proofs.n, proofs.subsets, strict=True):
        assert error_by_definition(p.W, p.chi, subset) == pytest.approx(best[n], rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_each_forward_step_explains_most_per_parameter(seed):
    p = grouped_problem(seed)
    taken_order = order("forward-selection", p)
    sizes = [0, *subsets("forward-selection", p)]

    def squared(kept):
        return error_by_definition(p.W, p.chi, kept) ** 2

    for n, after in pairwise(sizes):
        if after > 7:
            break
        before = squared(taken_order[:n])
        gains = [
            (before - squared([*taken_order[:n], *group])) / len(group)
            for group in p.groups
            if group[0] not in taken_order[:n]
        ]
        taken = (before - squared(taken_order[:after])) / (after - n)
        assert taken >= max(gains) * (1 - 1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_each_backward_step_loses_least_per_parameter(seed):
    p = grouped_problem(seed)
    taken_order = order("backward-elimination", p)
    for n, after in pairwise(subsets("backward-elimination", p)):
        if after > 9:
            break
        kept = taken_order[:after].tolist()
        now = error_by_definition(p.W, p.chi, kept) ** 2
        losses = []
        for group in p.groups:
            if group[0] in kept:
                rest = [k for k in kept if k not in group]
                losses.append((error_by_definition(p.W, p.chi, rest) ** 2 - now) / len(group))
        lost = (error_by_definition(p.W, p.chi, taken_order[:n]) ** 2 - now) / (after - n)
        assert lost <= min(losses) * (1 + 1e-6) + 1e-14


def test_a_tied_group_is_one_column_with_one_value():
    names = ("m_1", "m_2", "mx_1", "mx_2", "m_3")
    tied = Group("m_all", ("m_1", "m_2", "m_3"), tied=True)
    loose = Group("mx_all", ("mx_1", "mx_2"), tied=False)
    grouped = group_columns(names, np.array([9, 9, 5, 5, 9]), [tied, loose])
    columns = grouped.columns
    assert columns.names == ("m_all", "mx_1", "mx_2")
    assert [g.tolist() for g in grouped.groups] == [[1, 2]]
    assert grouped.preference.tolist() == [1, 2, 0]
    assert (columns.expansion @ [2.0, 3.0, 4.0]).tolist() == [2, 2, 3, 4, 2]
    rng = np.random.default_rng(0)
    W, chi = rng.normal(size=(30, 5)), rng.normal(size=30)
    p = problem(W @ columns.expansion, chi)
    # By hand: minimise over one common value for columns 0, 1 and 4.
    expected = np.linalg.lstsq(W[:, [0, 1, 4]].sum(axis=1)[:, None], chi, rcond=None)[0]
    assert fit(p, np.array([0])).parameters == pytest.approx(expected)


@pytest.mark.parametrize("seed", range(3))
def test_elimination_begins_with_what_causes_the_smallest_torques(seed):
    """A column that is another one's multiple, but hardly used, goes first of all."""
    rng = np.random.default_rng(seed)
    W = rng.normal(size=(40, 5))
    W = np.column_stack([W, W[:, 0] + 1e-3 * W[:, 1]])
    chi = W[:, :5] @ np.array([3.0, 1e-4, 2.0, -1.0, 1.0])
    assert order("backward-elimination", problem(W, chi))[-1] == 1


@pytest.mark.parametrize("seed", range(3))
def test_swaps_of_groups_improve_as_by_definition(seed):
    """Groups of two columns each, one of them with a column that depends on the subset."""
    pairs = tuple([k, k + 6] for k in range(6))
    p = dependent_problem(seed, rank=11, columns=12, groups=pairs)
    objective = TorqueObjective(p)
    kept = (1, 4, 2)
    before = error_by_definition(p.W, p.chi, objective.list_columns(kept)) ** 2
    found = objective._compute_improvements(kept)
    for place, out in enumerate(kept):
        for into in range(6):
            if into in kept:
                assert found[place, into] == -np.inf
                continue
            swapped = objective.list_columns((*(g for g in kept if g != out), into))
            after = error_by_definition(p.W, p.chi, swapped) ** 2
            assert found[place, into] == pytest.approx(before - after, rel=1e-6, abs=1e-9)
