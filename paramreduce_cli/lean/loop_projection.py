"""From the dynamics of an open tree to that of its loops, with R and b as inputs.

d_z = R' d_q, M_zz = R' M_qq R and delta_z = R' (delta_q + M_qq b) as in
:mod:`paramreduce_cli.multibody.loops.projection`; the independent rows of R are those of the identity
and of b zero.
"""

from collections.abc import Sequence

from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.lean.algebra import Scalar
from paramreduce_cli.records import Mechanism

_STATES = 3
"""q, dq and ddq come before R and b among the inputs."""


def project_inverse_outputs(
    mechanism: Mechanism, graph: Graph, outputs: Sequence[int]
) -> list[int]:
    """Return the torques in the independent coordinates, from those of the tree."""
    d_q = [Scalar(graph, value) for value in outputs]
    R, _ = _read_tangent(mechanism, graph)
    return [_multiply_vectors(column, d_q, graph).value for column in zip(*R, strict=True)]


def project_direct_outputs(mechanism: Mechanism, graph: Graph, outputs: Sequence[int]) -> list[int]:
    """Return the lower triangle of M_zz, row by row, then delta_z, from those of the tree."""
    n = mechanism.n_q
    flat = [Scalar(graph, value) for value in outputs]
    lower, delta = flat[:-n], flat[-n:]
    M = [[lower[max(i, j) * (max(i, j) + 1) // 2 + min(i, j)] for j in range(n)] for i in range(n)]
    R, b = _read_tangent(mechanism, graph)
    columns = list(zip(*R, strict=True))
    MR = [[_multiply_vectors(row, column, graph) for row in M] for column in columns]
    bias = [delta[i] + _multiply_vectors(M[i], b, graph) for i in range(n)]
    M_zz = [
        _multiply_vectors(columns[i], MR[j], graph)
        for i in range(len(columns))
        for j in range(i + 1)
    ]
    return [
        x.value for x in [*M_zz, *(_multiply_vectors(column, bias, graph) for column in columns)]
    ]


def _read_tangent(mechanism: Mechanism, graph: Graph) -> tuple[list[list[Scalar]], list[Scalar]]:
    """Return R and b of dq = R dz, ddq = R ddz + b as inputs of a graph: R, (n_q, n_dof), and b, (n_q,)."""
    n_z, dependent = mechanism.n_dof, mechanism.dependent
    zero, one = Scalar(graph, graph.constant(0.0)), Scalar(graph, graph.constant(1.0))
    R = [[zero] * n_z for _ in range(mechanism.n_q)]
    b = [zero] * mechanism.n_q
    for j, i in enumerate(mechanism.independent):
        R[i][j] = one
    start = mechanism.n_parameters + _STATES * mechanism.n_q
    for k, i in enumerate(dependent):
        R[i] = [Scalar(graph, graph.input(start + k * n_z + j)) for j in range(n_z)]
        b[i] = Scalar(graph, graph.input(start + len(dependent) * n_z + k))
    return R, b


def _multiply_vectors(a: Sequence[Scalar], b: Sequence[Scalar], graph: Graph) -> Scalar:
    """Return the scalar product of two vectors."""
    result = Scalar(graph, graph.constant(0.0))
    for x, y in zip(a, b, strict=True):
        result = result + x * y
    return result
