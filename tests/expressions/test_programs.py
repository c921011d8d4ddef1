import casadi as ca
import pytest

from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.expressions.programs import Program

x = ca.SX.sym("x", 4)


def count(*outputs, zero=(), **options):
    return Program.from_function(ca.Function("f", [x], [ca.vertcat(*outputs)])).count(
        zero, **options
    )


@pytest.mark.parametrize(
    ("outputs", "expected"),
    [
        ([x[0] + x[1]], 1),
        ([x[0] * x[1] + x[2]], 2),
        ([ca.sin(x[0]), ca.cos(x[0])], 2),
        ([x[0] * x[1], x[1] * x[0]], 1),
        ([x[0] + x[1], x[1] + x[0]], 1),
        ([x[0] - x[1], x[1] - x[0]], 1),
        ([x[0] * x[1], -(x[0] * x[1])], 1),
        ([-x[0] * x[1], x[0] * -x[1]], 1),
        ([ca.sin(-x[0]), ca.sin(x[0])], 1),
        ([ca.cos(-x[0]), ca.cos(x[0])], 1),
        ([x[0] ** 2, x[0] * x[0]], 1),
        ([2 * x[0], x[0] + x[0]], 1),
        ([1 * x[0], 0 * x[1], x[2] + 0], 0),
        ([(x[0] + x[1]) * (x[0] + x[1])], 2),
        ([x[0] / x[1]], 1),
    ],
)
def test_equal_subexpressions_count_once_and_signs_are_free(outputs, expected):
    assert count(*outputs) == expected


@pytest.mark.parametrize(
    ("outputs", "zero", "expected"),
    [
        ([x[0] * x[1] + x[2] * x[3]], (0,), 1),
        ([x[0] * x[1] + x[2] * x[3]], (0, 2), 0),
        ([(x[0] + x[1]) * x[2]], (0,), 1),
        ([x[0] - x[1]], (0,), 0),
        ([ca.sin(x[0]) * x[1]], (1,), 0),
    ],
)
def test_zero_inputs_annihilate_what_they_touch(outputs, zero, expected):
    assert count(*outputs, zero=zero) == expected


def test_signs_cost_where_they_are_counted():
    negated = [-(x[0] * x[1]) * x[2]]
    assert count(*negated) == 2
    assert count(*negated, signs_free=False) == 3
    assert count(x[0] - x[1], signs_free=False) == 1


def test_a_difference_is_one_operation_in_programs_made_from_graphs():
    graph = Graph()
    a, b, c = (graph.input(k) for k in range(3))
    difference = graph.subtract(a, b)
    program = Program.from_graph(graph, [difference, graph.subtract(graph.negate(a), c)])
    assert program.count() == 2
    assert program.count(signs_free=False) == 3  # of -a - c the sign is one
    assert Program.from_graph(graph, [difference]).count(signs_free=False) == 1
    assert Program.from_graph(graph, [graph.subtract(b, a)]).count(signs_free=False) == 1
