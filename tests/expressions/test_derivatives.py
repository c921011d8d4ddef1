"""Derivatives of graphs against finite differences."""

import numpy as np
import pytest

from paramreduce_cli.expressions.derivatives import differentiate, find_gradient
from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.expressions.programs import Program

INPUTS = np.array([0.7, -0.4, 1.3])
STEP = 1e-6


def build(graph):
    """Values that use every rule, also of negated references and of values used twice."""
    a, b, c = (graph.input(k) for k in range(3))
    sine, cosine = graph.call("sin", graph.add(a, b)), graph.call("cos", graph.multiply(b, c))
    product = graph.multiply(sine, graph.negate(cosine))
    length = graph.call("sqrt", graph.add(graph.multiply(a, a), graph.multiply(c, c)))
    ratio = graph.call("/", product, length)
    smooth = graph.call("tanh", graph.multiply(graph.constant(3.0), b))
    return [
        product,
        graph.negate(graph.add(product, graph.multiply(product, a))),
        ratio,
        graph.multiply(smooth, graph.call("inv", length)),
        graph.multiply(graph.call("sign", b), a),
        graph.constant(2.0),
    ]


def evaluate(graph, outputs, inputs):
    return np.array(
        [float(x) for x in Program.from_graph(graph, outputs).evaluate([*map(np.float64, inputs)])]
    )


@pytest.mark.parametrize("position", range(3))
def test_derivatives_are_those_of_differences(position):
    graph = Graph()
    outputs = build(graph)
    found = evaluate(graph, differentiate(graph, outputs, position), INPUTS)
    move = STEP * np.eye(3)[position]
    ends = [evaluate(graph, outputs, INPUTS + sign * move) for sign in (1, -1)]
    assert found == pytest.approx((ends[0] - ends[1]) / (2 * STEP), rel=1e-7, abs=1e-9)


def test_gradients_are_the_derivatives_by_each_input():
    graph = Graph()
    outputs = build(graph)
    for k, output in enumerate(outputs):
        gradient = find_gradient(graph, output)
        for position in range(3):
            (forward,) = differentiate(graph, [output], position)
            pair = evaluate(graph, [gradient.get(position, 0), forward], INPUTS)
            assert pair[0] == pytest.approx(pair[1], rel=1e-13), (k, position)


def test_what_does_not_depend_on_an_input_has_no_derivative():
    graph = Graph()
    output = graph.call("sin", graph.input(0))
    assert differentiate(graph, [output, graph.constant(3.0)], 1) == [0, 0]


def test_functions_without_a_rule_are_refused():
    graph = Graph()
    with pytest.raises(NotImplementedError, match="atan"):
        differentiate(graph, [graph.call("atan", graph.input(0))], 0)
    with pytest.raises(NotImplementedError, match="atan"):
        find_gradient(graph, graph.call("atan", graph.input(0)))
