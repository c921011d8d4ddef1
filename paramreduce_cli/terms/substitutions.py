"""Substitutions: nodes of a program that are nearly a multiple of another node, or nearly constant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from paramreduce_cli.records import BoolArray, FloatArray, IntArray
from paramreduce_cli.terms.pruning import NUMBER

_OTHERS = 3
"""Nodes that are offered for each one."""
_WAYS = 400
"""Most promising ones of all that are offered."""


@dataclass(frozen=True)
class Substitutions:
    """The substitutions of nodes by multiples of others."""

    nodes: IntArray
    """(n_ways,)"""
    sources: IntArray
    """Nodes that these would stand for, NUMBER for numbers, (n_ways,)."""
    factors: FloatArray
    """Factors of the substitutes, or the numbers, (n_ways,)."""

    def __getitem__(self, which: IntArray) -> Substitutions:
        return Substitutions(self.nodes[which], self.sources[which], self.factors[which])

    def add_ones(self, nodes: IntArray) -> Substitutions:
        """Return the substitutions with further ones, by the number one."""
        return Substitutions(
            np.concatenate([self.nodes, nodes]),
            np.concatenate([self.sources, np.full(nodes.size, NUMBER)]),
            np.concatenate([self.factors, np.ones(nodes.size)]),
        )

    def get(self, which: int) -> tuple[int, int, float]:
        """Return node, source and factor of one substitution."""
        return int(self.nodes[which]), int(self.sources[which]), float(self.factors[which])

    def estimate_changes(self, values: FloatArray, pulls: FloatArray) -> FloatArray:
        """Return what the rows lose by each substitution, to first order, (n_substitutions, n_rows): present minus
        substituted values, times the derivatives.

        Args:
            values: Values of all nodes, (n_nodes, n_samples).
            pulls: Weighted derivatives of the rows with respect to all nodes, (n_nodes, n_dof, n_samples).
        """
        stand_in = np.where(
            (self.sources == NUMBER)[:, None],
            self.factors[:, None],
            self.factors[:, None] * values[self.sources],
        )
        lost = pulls[self.nodes] * (values[self.nodes] - stand_in)[:, None]
        return lost.reshape(len(self.nodes), pulls[0].size)


def find_substitutions(
    values: FloatArray, pulls: FloatArray, residual: FloatArray, free: BoolArray, linear: BoolArray
) -> Substitutions:
    """Return the most promising replacements of nodes by multiples of earlier nodes.

    Let w be the weighted derivatives of the rows with respect to node k, v the values and r the residual. The cost of c
    v_j in place of v_k is c^2 sum w^2 v_j^2 - 2 c sum (w^2 v_k v_j + w r v_j) + constant, whose minimum is known in
    closed form. Factors of one save a product and are offered beside the best factors; nodes that do not depend on
    parameters may be replaced by numbers.

    Args:
        values: Values of the nodes, (n_nodes, n_samples).
        pulls: Weighed derivatives of the rows by the nodes, (n_nodes, n_dof, n_samples).
        residual: Residuals, (n_dof, n_samples).
        free: Mask of the nodes that may be replaced, (n_nodes,).
        linear: Mask of the nodes that are linear in the parameters, (n_nodes,); they are replaced by each other only.
    """
    squares = np.einsum("nqm,nqm->nm", pulls, pulls)
    along = np.einsum("nqm,qm->nm", pulls, residual)
    used = squares.any(axis=1)
    nodes = np.flatnonzero(free & used)
    v, squares, along = values[nodes], squares[nodes], along[nodes]
    here = np.einsum("nm,nm->n", squares, v**2) + 2 * np.einsum("nm,nm->n", along, v)

    across = (squares * v + along) @ values.T
    size = squares @ (values**2).T
    possible = np.arange(len(values)) < nodes[:, None]
    possible &= (linear[nodes][:, None] == linear) & used & (size > 0)
    size[~possible] = 1.0
    costs = np.where(possible, here[:, None] - across**2 / size, np.inf)
    order = np.argsort(costs, axis=1, kind="stable")[:, :_OTHERS]
    rows = np.arange(len(nodes))[:, None]
    factors = (across[rows, order] / size[rows, order]).ravel()
    costs = costs[rows, order].ravel()
    found = Substitutions(np.repeat(nodes, order.shape[1]), order.ravel(), factors)
    found = found[np.argsort(costs, kind="stable")[: min(_WAYS, int(np.isfinite(costs).sum()))]]

    plain = ~linear[nodes]
    sums = np.einsum("nm,nm->n", squares, v) + along.sum(axis=1)
    numbers = (sums / squares.sum(axis=1))[plain]
    fixed = np.full(numbers.size, NUMBER)
    ones = np.copysign(1.0, found.factors)
    return Substitutions(
        np.concatenate([found.nodes, found.nodes, nodes[plain]]),
        np.concatenate([found.sources, found.sources, fixed]),
        np.concatenate([found.factors, ones, numbers]),
    )
