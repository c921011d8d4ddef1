"""Annealed formulations: never worse, the same on every run, and of the same dynamics."""

import numpy as np
import pytest

from paramreduce_cli.expressions.factoring import Written
from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.lean.annealing import annealed
from paramreduce_cli.lean.building import direct_outputs, inverse_outputs
from paramreduce_cli.lean.checking import check_formulations
from paramreduce_cli.lean.choices import from_data
from paramreduce_cli.lean.search import formulations
from paramreduce_cli.lean.tree import lean_tree

LOOKS, TRIES = 8, 4000


def counted(tree, build, choices, dropped):
    graph = Graph()
    return Written(graph, build(tree, choices, graph, dropped)).rewritten_count(TRIES)


@pytest.mark.parametrize(
    ("build", "kind"), [(inverse_outputs, "inverse"), (direct_outputs, "direct")]
)
def test_what_is_found_is_no_worse_and_found_again(puma, build, kind):
    tree = lean_tree(puma.mechanism)
    dropped = set(np.flatnonzero(~puma.affecting).tolist())
    start = [from_data(data) for data in getattr(puma.formulations, kind)[-1]]
    found = [list(annealed(tree, build, start, dropped, LOOKS, seed)) for seed in (0, 0, 1)]
    assert len(found[0]) == LOOKS
    assert found[0] == found[1]
    for some in found:
        counts = [counted(tree, build, choices, dropped) for choices in (start, some[0], some[-1])]
        assert counts == sorted(counts, reverse=True)
    assert any(some[-1] != start for some in found)


def test_they_are_formulations_of_the_same_dynamics(puma):
    said = []
    found = formulations(
        puma.mechanism, puma.affecting, puma.base.columns, said.append, looks=3, seed=3
    )
    assert [(p.done, p.total) for p in said if p.total == 12] == [(k, 12) for k in range(1, 13)]
    rng = np.random.default_rng(0)
    kept = np.flatnonzero(puma.affecting)
    states = tuple(rng.normal(size=(3, 20, 6)))
    check_formulations(puma.mechanism, found, kept, states, rng)
