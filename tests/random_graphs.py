"""Random expression graphs and their values."""

import numpy as np
from hypothesis import strategies as st

from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.expressions.programs import Program

INPUTS = 5


@st.composite
def expressions(draw):
    """A graph of sums, differences, products and sines, and some of its values."""
    graph = Graph()
    values = [graph.input(k) for k in range(INPUTS)]
    values += [graph.constant(c) for c in (2.0, -0.5)]
    index = st.integers(0, 10**6)
    for _ in range(draw(st.integers(1, 40))):
        a, b = (values[draw(index) % len(values)] for _ in range(2))
        kind = draw(st.sampled_from("+-**s"))
        if kind == "s":
            values.append(graph.call("sin", a))
        else:
            join = {"+": graph.add, "-": graph.subtract, "*": graph.multiply}[kind]
            values.append(join(a, b))
    outputs = [values[-1 - k] for k in range(draw(st.integers(1, min(6, len(values)))))]
    return graph, outputs


def evaluated(graph, outputs, seed=0):
    rng = np.random.default_rng(seed)
    inputs = list(rng.uniform(-1, 1, size=(INPUTS, 7)))
    values = Program.from_graph(graph, outputs).evaluate(inputs)
    return np.array([np.broadcast_to(value, 7) for value in values])
