"""Graphs and their factoring: values stay, operations get no more."""

import numpy as np
import pytest
from hypothesis import given, settings
from random_graphs import evaluated, expressions

from paramreduce_cli.expressions.factoring import Values, minimise_operations
from paramreduce_cli.expressions.graph import ZERO, Graph
from paramreduce_cli.expressions.programs import Program


@settings(max_examples=150, deadline=None)
@given(expressions())
def test_factoring_keeps_values(made):
    graph, outputs = made
    target, changed = minimise_operations([Values(graph, outputs)])
    expected = evaluated(graph, outputs)
    np.testing.assert_allclose(
        evaluated(target, changed), expected, rtol=1e-9, atol=1e-9 * (1 + np.abs(expected).max())
    )


@settings(max_examples=100, deadline=None)
@given(expressions())
def test_the_least_form_never_takes_more(made):
    graph, outputs = made
    target, changed = minimise_operations([Values(graph, outputs)])
    assert target.count_operations(changed) <= graph.count_operations(outputs)


@settings(max_examples=100, deadline=None)
@given(expressions())
def test_a_program_builds_the_same_graph_again(made):
    graph, outputs = made
    program = Program.from_graph(graph, outputs)
    again = Graph()
    rebuilt = program.rebuild(again)
    assert (
        again.count_operations(rebuilt) <= graph.count_operations(outputs) == program.n_operations
    )
    np.testing.assert_allclose(
        evaluated(again, rebuilt), evaluated(graph, outputs), rtol=1e-9, atol=1e-9
    )


def test_signs_and_constants_vanish():
    graph = Graph()
    x, y = graph.input(0), graph.input(1)
    assert graph.add(x, graph.negate(x)) == ZERO
    assert graph.multiply(graph.negate(x), graph.negate(y)) == graph.multiply(y, x)
    assert graph.subtract(x, y) == graph.negate(graph.subtract(y, x))
    assert graph.multiply(graph.constant(0.0), x) == ZERO
    half = graph.multiply(graph.constant(0.5), x)
    assert graph.multiply(graph.constant(2.0), half) == x
    assert graph.number(graph.call("cos", ZERO)) == 1.0
    assert graph.call("cos", graph.negate(x)) == graph.call("cos", x)


@pytest.mark.parametrize(
    ("terms", "expected"),
    [
        # a b + a c = a (b + c)
        ([[(0, 1), (0, 2)]], 2),
        # a b + a c + a d, a taken out once
        ([[(0, 1), (0, 2), (0, 3)]], 3),
        # a b c and a b d share a b
        ([[(0, 1, 2)], [(0, 1, 3)]], 3),
        # (a + b) + c and (a + c) + b are one
        ([[(0,), (1,), (2,)], [(0,), (2,), (1,)]], 2),
        # a + b + c and a + b + d share a + b
        ([[(0,), (1,), (2,)], [(0,), (3,), (1,)]], 3),
    ],
)
def test_the_laws_of_sums_and_products(terms, expected):
    graph = Graph()
    outputs = []
    for total in terms:
        value = ZERO
        for factors in total:
            product = graph.constant(1.0)
            for factor in factors:
                product = graph.multiply(product, graph.input(factor))
            value = graph.add(value, product)
        outputs.append(value)
    target, changed = minimise_operations([Values(graph, outputs)])
    assert target.count_operations(changed) == expected


def test_of_two_ways_the_least_takes_no_more_than_either():
    graph = Graph()
    a, b, c, d = (graph.input(k) for k in range(4))
    products = [graph.multiply(x, y) for x, y in ((a, c), (a, d), (b, c), (b, d))]
    long = [graph.add(graph.add(products[0], products[1]), graph.add(products[2], products[3]))]
    short = [graph.multiply(graph.add(a, b), graph.add(c, d))]
    ways = [Values(graph, long), Values(graph, short)]
    assert minimise_operations(ways).n_operations <= min(
        minimise_operations([way]).n_operations for way in ways
    )
    assert minimise_operations(ways).n_operations == 3
