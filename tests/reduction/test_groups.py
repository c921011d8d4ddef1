"""Groups: parameters that are selected together, with a value each or one for all."""

from itertools import pairwise

import numpy as np
import pytest
from oracles.selection import error_by_definition

from paramreduce_cli import registry
from paramreduce_cli.reduction.fitting import fit
from paramreduce_cli.reduction.grouping import Group, grouped_columns
from paramreduce_cli.reduction.problem import SelectionProblem

GROUPS = (np.array([0, 3, 5]), np.array([1, 7]))


def problem(seed, rank=9, columns=12, groups=GROUPS):
    rng = np.random.default_rng(seed)
    W = rng.normal(size=(60, rank)) @ rng.normal(size=(rank, columns))
    chi = W @ rng.normal(size=columns)
    return SelectionProblem(W, chi, np.arange(columns), np.arange(columns), groups)


@pytest.mark.parametrize("name", list(registry.heuristic))
@pytest.mark.parametrize("seed", range(4))
def test_groups_stay_together(name, seed):
    p = problem(seed)
    order = registry.heuristic[name](p)
    assert sorted(order) == list(range(12))
    sizes = p.sizes(order)
    assert sizes.size == 12 - 3
    for n in sizes:
        chosen = set(order[:n].tolist())
        assert all(not chosen & set(g) or set(g) <= chosen for g in GROUPS)


@pytest.mark.parametrize("seed", range(4))
def test_each_forward_step_explains_most_per_parameter(seed):
    p = problem(seed)
    order = registry.heuristic["forward-selection"](p)
    sizes = [0, *p.sizes(order)]

    def squared(kept):
        return error_by_definition(p.W, p.chi, list(kept)) ** 2 if len(kept) else 1.0

    for n, after in pairwise(sizes):
        if after > 7:
            break
        before = squared(order[:n])
        gains = {
            tuple(unit): (before - squared([*order[:n], *unit])) / len(unit)
            for unit in map(tuple, p.units())
            if unit[0] not in order[:n]
        }
        taken = (before - squared(order[:after])) / (after - n)
        assert taken >= max(gains.values()) * (1 - 1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_each_backward_step_loses_least_per_parameter(seed):
    p = problem(seed)
    order = registry.heuristic["backward-elimination"](p)
    sizes = p.sizes(order).tolist()
    for n, after in pairwise(sizes):
        if after > 9:
            break
        kept = order[:after].tolist()
        now = error_by_definition(p.W, p.chi, kept) ** 2
        losses = []
        for unit in map(tuple, p.units()):
            if unit[0] in kept:
                rest = [k for k in kept if k not in unit]
                squared = error_by_definition(p.W, p.chi, rest) ** 2 if rest else 1.0
                losses.append((squared - now) / len(unit))
        lost = (error_by_definition(p.W, p.chi, order[:n]) ** 2 - now) / (after - n)
        assert lost <= min(losses) * (1 + 1e-6) + 1e-14


def test_without_groups_every_size_exists():
    p = problem(0, groups=())
    assert p.sizes(np.arange(12)).tolist() == list(range(1, 13))


def test_a_tied_group_is_one_column_with_one_value():
    names = ("m_1", "m_2", "mx_1", "mx_2", "m_3")
    tied = Group("m_all", ("m_1", "m_2", "m_3"), tied=True)
    loose = Group("mx_all", ("mx_1", "mx_2"), tied=False)
    columns = grouped_columns(names, [tied, loose])
    assert columns.names == ("m_all", "mx_1", "mx_2")
    assert [g.tolist() for g in columns.groups] == [[1, 2]]
    assert (columns.expansion @ [2.0, 3.0, 4.0]).tolist() == [2, 2, 3, 4, 2]
    rng = np.random.default_rng(0)
    W, chi = rng.normal(size=(30, 5)), rng.normal(size=30)
    merged = W @ columns.expansion
    p = SelectionProblem(merged, chi, np.arange(3), np.arange(3))
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
    p = SelectionProblem(W, chi, np.arange(6), np.arange(6))
    order = registry.heuristic["backward-elimination"](p)
    assert order[-1] == 1
