"""Rewriting: values stay, operations get no more, and what factoring cannot find is found."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from random_graphs import evaluated, expressions

from paramreduce_cli.expressions.factoring import Values, minimise_operations
from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.expressions.programs import Program
from paramreduce_cli.expressions.rewriting import rewrite
from paramreduce_cli.expressions.rows import (
    COST,
    DICE,
    FAILED,
    KIND,
    NONE,
    PRODUCT,
    SUM,
    USES,
    list_terms,
)


def state(rows):
    return list_terms(rows, SUM), list_terms(rows, PRODUCT), int(rows.counters[COST])


@settings(max_examples=100, deadline=None)
@given(expressions(), st.integers(0, 10**6))
def test_values_stay_and_operations_get_no_more(made, seed):
    graph, outputs = made
    way = Values(graph, outputs)
    rows = way.to_rows()
    rows.counters[DICE] = seed
    expected = evaluated(graph, outputs)
    before = rows.counters[COST]
    for tries in (0, 5, 50):
        rewrite(rows, tries)
        assert rows.counters[COST] <= before
        before = rows.counters[COST]
        changed = way.from_rows(rows)
        assert changed.n_operations <= before
        np.testing.assert_allclose(
            evaluated(*changed), expected, rtol=1e-8, atol=1e-8 * (1 + np.abs(expected).max())
        )


@settings(max_examples=50, deadline=None)
@given(expressions())
def test_counts_and_chains_are_those_of_the_rows(made):
    graph, outputs = made
    rows = Values(graph, outputs).to_rows()
    calls = rows.counters[COST] - sum(
        len(row) - 1 for kind in (SUM, PRODUCT) for row in list_terms(rows, kind).values()
    )
    rewrite(rows, 60)
    sums, products, cost = state(rows)
    assert cost == calls + sum(len(row) - 1 for row in (*sums.values(), *products.values()))
    held = np.zeros(rows.numbers.shape[0], dtype=int)
    for row in (*sums.values(), *products.values()):
        np.add.at(held, np.array(row) >> 1, 1)
    np.testing.assert_array_equal(held, rows.numbers[:, USES])
    assert all(value % 2 == 0 for row in products.values() for value in row)


def test_where_there_is_no_room_everything_stays():
    graph = Graph()
    a, b, c, d = (graph.input(k) for k in range(4))
    total = graph.add(graph.multiply(a, b), graph.multiply(c, d))
    rows = Values(
        graph, [graph.multiply(total, graph.add(a, d)), graph.multiply(total, b)]
    ).to_rows()
    rewrite(rows, 0)
    before = state(rows)
    rows.numbers[rows.numbers[:, KIND] == NONE, USES] += 1  # so that no number is free
    rewrite(rows, 200)
    assert state(rows) == before
    assert not rows.counters[FAILED]


def products(graph, *factors):
    result = graph.constant(1.0)
    for factor in factors:
        result = graph.multiply(result, factor)
    return result


def test_a_factor_is_distributed_where_it_lets_products_be_shared():
    graph = Graph()
    two = graph.constant(2.0)
    rate, other, sine, u, v, w = (graph.input(k) for k in range(6))
    turned = graph.multiply(rate, sine)
    both = graph.multiply(rate, other)
    bracket = graph.add(products(graph, rate, w, u), graph.multiply(both, v))
    outputs = [
        turned,
        graph.multiply(two, both),
        graph.multiply(two, graph.multiply(turned, w)),
        graph.multiply(two, bracket),
    ]
    # turned, D = 2 rate, E = D w, F = D other, E sine, E u + F v
    assert minimise_operations([Values(graph, outputs)]).n_operations == 8


def test_what_cancels_between_sums_that_are_used_elsewhere_vanishes():
    graph = Graph()
    a, b, c, d = (graph.input(k) for k in range(4))
    first = graph.subtract(a, b)
    second = graph.subtract(b, c)
    outputs = [graph.multiply(first, d), graph.multiply(graph.add(first, second), second)]
    # a - b, b - c, a - c and two products
    assert minimise_operations([Values(graph, outputs)]).n_operations == 5


def test_it_repeats_itself():
    graph = Graph()
    x = [graph.input(k) for k in range(5)]
    total = x[0]
    outputs = []
    for k in range(12):
        total = graph.add(graph.multiply(total, x[k % 5]), x[(3 * k + 1) % 5])
        outputs.append(graph.multiply(total, x[(2 * k) % 5]))
    for dice in (0, 1234567):
        found = [minimise_operations([Values(graph, outputs)], dice) for _ in range(2)]
        assert found[0].graph.nodes == found[1].graph.nodes
        assert found[0].outputs == found[1].outputs


def test_other_dice_write_the_same_values_in_other_ways():
    graph = Graph()
    x = [graph.input(k) for k in range(7)]
    rng = np.random.default_rng(0)
    outputs = []
    for _ in range(10):
        total = x[int(rng.integers(7))]
        for k in rng.permutation(7)[:4]:
            total = graph.add(total, x[k])
        outputs.append(total)
    given = rng.normal(size=7)
    expected = Program.from_graph(graph, outputs).evaluate([*given])
    found = [
        Program.from_graph(*minimise_operations([Values(graph, outputs)], dice))
        for dice in (0, 1, 10**12)
    ]
    assert len(set(found)) > 1
    for one in found:
        np.testing.assert_allclose(one.evaluate([*given]), expected, rtol=1e-12)


def test_where_nothing_can_be_rewritten_it_ends():
    graph = Graph()
    rows = Values(graph, [graph.call("sin", graph.input(0))]).to_rows()
    rewrite(rows, 3)
    assert state(rows) == ({}, {}, 1)
