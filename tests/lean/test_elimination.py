"""Sparse elimination in a fixed order against dense solvers."""

import numpy as np
import pytest

from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.expressions.programs import Program
from paramreduce_cli.lean.algebra import Scalar
from paramreduce_cli.lean.elimination import Elimination, choose_pivots


def draw_matrices(rng, n, density, count):
    """Random regular matrices of one sparsity pattern: a permuted diagonal, and some entries besides."""
    pattern = np.eye(n, dtype=bool)[rng.permutation(n)] | (rng.random((n, n)) < density)
    samples = rng.normal(size=(count, n, n)) * pattern
    return pattern, samples[np.linalg.cond(samples) < 1e4]


def solve_in_graph(pattern, blocks, matrices, right):
    """Solve by the elimination of a matrix of inputs, and return solutions and pivots."""
    n = len(pattern)
    graph = Graph()
    zero = Scalar(graph, graph.constant(0.0))
    matrix = [
        [Scalar(graph, graph.input(i * n + j)) if pattern[i, j] else zero for j in range(n)]
        for i in range(n)
    ]
    elimination = Elimination(matrix, blocks)
    x = elimination.solve([Scalar(graph, graph.input(n * n + i)) for i in range(n)])
    outputs = [value.value for value in (*x, *elimination.pivots)]
    inputs = [*matrices.reshape(len(matrices), -1).T, *right.T]
    values = np.column_stack(Program.from_graph(graph, outputs).evaluate(inputs))
    return values[:, :n], values[:, n:]


@pytest.mark.parametrize("seed", range(20))
def test_solutions_are_those_of_a_dense_solver(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 12))
    pattern, matrices = draw_matrices(rng, n, rng.uniform(0.05, 0.6), 200)
    right = rng.normal(size=(len(matrices), n))
    blocks = choose_pivots(pattern, matrices)
    x, pivots = solve_in_graph(pattern, blocks, matrices, right)
    expected = np.linalg.solve(matrices, right[..., None])[..., 0]
    least = np.array([pivot.least for block in blocks for pivot in block])
    np.testing.assert_allclose(np.abs(pivots).min(axis=0), least, rtol=1e-6)
    error = np.abs(x - expected).max(axis=1) / np.abs(expected).max(axis=1)
    assert np.median(error) < 1e-12
    assert error[(np.abs(pivots) > 0.05).all(axis=1)].max(initial=0.0) < 1e-8


def test_blocks_are_solved_one_after_the_other():
    rng = np.random.default_rng(0)
    triangular = np.kron(np.tril(np.ones((3, 3), dtype=bool)), np.ones((2, 2), dtype=bool))
    rows, columns = rng.permutation(6), rng.permutation(6)
    pattern = triangular[rows][:, columns]
    blocks = choose_pivots(pattern, rng.normal(size=(50, 6, 6)) * pattern)
    assert [len(block) for block in blocks] == [2, 2, 2]
    unknowns = [{int(columns[p.column]) // 2 for p in block} for block in blocks]
    assert unknowns == [{0}, {1}, {2}]


def test_pivots_that_vanish_on_a_sample_are_avoided():
    samples = np.array([[[0.0, 1.0], [1.0, 0.3]], [[0.7, 1.0], [1.0, 0.0]]])
    ((first, second),) = choose_pivots(np.ones((2, 2), dtype=bool), samples)
    assert first.row != first.column
    assert first.least == 1.0
    assert second.least > 0.5
