"""A program in arrays, and which of its terms remain."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paramreduce_cli.records import BoolArray, FloatArray, IntArray

NUMBER = -1
"""Source of a node that is replaced by a number."""
FIRST, SECOND, WHOLE, ITSELF = range(4)
"""What a term is of its node: the first or second operand of a sum, the node as a whole, or the node in place of the
node that replaces it."""


class Instructions(NamedTuple):
    """A program before pruning; operands of a node come before it."""

    codes: IntArray
    """Code of the operation, (n_nodes,)."""
    operands: IntArray
    """Twice the number of the operand's node, plus one if it is negated, (n_nodes, 2)."""
    numbers: FloatArray
    """Value of a constant, position of an input, (n_nodes,)."""
    outputs: IntArray
    """Twice the number of the output's node, plus one if it is negated, (n_outputs,)."""


class Pruning(NamedTuple):
    """A pruning of a program: which terms remain, and which nodes are replaced by others."""

    kept: BoolArray
    """Whether the first operand, the second operand (both matter to sums alone) and the node itself are kept, (n_nodes, 3)."""
    source: IntArray
    """Earlier node that replaces a node, the node itself if none does, or NUMBER, (n_nodes,)."""
    factor: FloatArray
    """Factor of the node that replaces it, or the number, (n_nodes,)."""

    @classmethod
    def keep_all(cls, size: int) -> Pruning:
        """Return the pruning that keeps all nodes of a program with ``size`` nodes."""
        return cls(np.ones((size, 3), dtype=np.bool_), np.arange(size), np.ones(size))

    def has(self, terms: IntArray) -> BoolArray:
        """Return a mask of terms that are neither removed nor replaced; terms are as in :meth:`Tape.list_candidates`."""
        nodes, what = terms.T
        kept: BoolArray = self.kept[nodes, np.minimum(what, WHOLE)]
        return np.where(what == ITSELF, self.source[nodes] == nodes, kept)

    def flip(self, terms: IntArray) -> Pruning:
        """Return the pruning with some terms flipped: removed terms return, present ones are removed, and a replaced
        node takes its own value again.
        """
        kept, source, factor = self.kept.copy(), self.source.copy(), self.factor.copy()
        own = terms[:, 1] == ITSELF
        kept[tuple(terms[~own].T)] ^= True
        source[terms[own, 0]], factor[terms[own, 0]] = terms[own, 0], 1.0
        return Pruning(kept, source, factor)

    def replace(self, node: int, source: int, factor: float) -> Pruning:
        """Return the pruning in which a node is replaced by a multiple of an earlier node, or by a number."""
        sources, factors = self.source.copy(), self.factor.copy()
        sources[node], factors[node] = source, factor
        return Pruning(self.kept, sources, factors)
