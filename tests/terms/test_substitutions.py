"""Nodes that stand for others, against trying them all and against what they do to outputs."""

import numpy as np
import pytest

from paramreduce_cli.terms.kernels import NUMBER
from paramreduce_cli.terms.substitutions import find_substitutions

N, DOF, SAMPLES = 9, 2, 30


@pytest.fixture
def nodes():
    """Values, weighed derivatives, a residual; node 5 is nearly -1.5 times node 2, node 7 nearly 0.8."""
    rng = np.random.default_rng(0)
    values, pulls = rng.normal(size=(N, SAMPLES)), rng.normal(size=(N, DOF, SAMPLES))
    values[5] = -1.5 * values[2] + 0.01 * rng.normal(size=SAMPLES)
    values[7] = 0.8 + 0.01 * rng.normal(size=SAMPLES)
    return values, pulls, 0.001 * rng.normal(size=(DOF, SAMPLES))


def cost(values, pulls, residual, node, stand_in):
    """By definition: the square of the residual with what the rows lose, less that without."""
    lost = pulls[node] * (values[node] - stand_in)
    return np.sum((residual + lost) ** 2) - np.sum(residual**2)


def test_the_nearest_ones_are_found_with_the_best_factors(nodes):
    values, pulls, residual = nodes
    linear = np.zeros(N, dtype=bool)
    ways = find_substitutions(values, pulls, residual, np.ones(N, dtype=bool), linear)
    found = dict(zip(zip(ways.nodes, ways.sources, strict=True), ways.factors, strict=True))
    assert ways.get(0)[:2] == (5, 2), "the most promising one comes first"
    assert ways.get(0)[2] == pytest.approx(-1.5, abs=0.01)
    assert found[7, NUMBER] == pytest.approx(0.8, abs=0.01)
    assert (ways.sources < ways.nodes).all()
    for node, source, factor in zip(ways.nodes, ways.sources, ways.factors, strict=True):
        if abs(factor) == 1.0:
            continue

        def at(c, node=node, source=source):
            return cost(
                values, pulls, residual, node, c if source == NUMBER else c * values[source]
            )

        assert at(factor) <= min(at(factor + 1e-3), at(factor - 1e-3)), "no other factor is better"
    # Of all nodes before it, the nearest ones are offered.
    for node in range(4, N):
        best = {
            j: min(
                cost(values, pulls, residual, node, c * values[j]) for c in np.linspace(-3, 3, 1201)
            )
            for j in range(node)
        }
        assert (node, min(best, key=best.get)) in found


def test_like_stands_for_like_alone(nodes):
    values, pulls, residual = nodes
    linear = np.arange(N) % 2 == 1
    free = np.arange(N) != 5
    pulls[8] = 0
    ways = find_substitutions(values, pulls, residual, free, linear)
    assert set(ways.nodes) == {2, 3, 4, 6, 7, 0}, "0 for a number alone, 1 for nothing"
    others = ways.sources != NUMBER
    np.testing.assert_array_equal(linear[ways.nodes[others]], linear[ways.sources[others]])
    assert not linear[ways.nodes[~others]].any()
    assert 8 not in ways.sources


def test_there_may_be_nothing_to_stand_for(nodes):
    values, pulls, residual = nodes
    ways = find_substitutions(
        values, pulls, residual, np.zeros(N, dtype=bool), np.ones(N, dtype=bool)
    )
    assert ways.nodes.size == 0
    assert ways.estimate_changes(values, pulls).shape == (0, DOF * SAMPLES)


def test_changes_are_what_rows_lose(nodes):
    values, pulls, residual = nodes
    ways = find_substitutions(
        values, pulls, residual, np.ones(N, dtype=bool), np.zeros(N, dtype=bool)
    )
    for k, lost in enumerate(ways.estimate_changes(values, pulls)):
        node, source, factor = ways.get(k)
        stand_in = factor if source == NUMBER else factor * values[source]
        np.testing.assert_allclose(lost, (pulls[node] * (values[node] - stand_in)).ravel())
