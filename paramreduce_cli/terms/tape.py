"""A program in arrays, of which terms can be left out: values, derivatives and operations.

A term is an operand of a sum, or a node as a whole, which then is zero wherever it is used. Instead
a node may stand for another one times a factor, or for a number. Programs are linear in their
parameters, which are their first inputs, and stay so.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from paramreduce_cli.expressions.graph import ZERO, Graph, Node
from paramreduce_cli.expressions.operations import Program
from paramreduce_cli.records import BoolArray, FloatArray, IntArray
from paramreduce_cli.terms import kernels
from paramreduce_cli.terms.kernels import (
    CODES,
    CONSTANT,
    FIRST,
    INPUT,
    ITSELF,
    NONE,
    NUMBER,
    SECOND,
    SUM,
    WHOLE,
)


@dataclass(frozen=True)
class Remains:
    """What is left of a program."""

    kept: BoolArray
    """Of every node whether its first and its second operand are kept, which matters to sums, and whether
    it is kept itself, (n_nodes, 3)."""
    source: IntArray
    """The node before it that a node stands for, mostly itself; NUMBER for a number, (n_nodes,)."""
    factor: FloatArray
    """By which that is multiplied, or the number, (n_nodes,)."""

    def has(self, terms: IntArray) -> BoolArray:
        """Which terms, as :meth:`Tape.candidates` gives them, are as in the whole program."""
        nodes, what = terms.T
        kept: BoolArray = self.kept[nodes, np.minimum(what, WHOLE)]
        return np.where(what == ITSELF, self.source[nodes] == nodes, kept)

    def flipped(self, terms: IntArray) -> Remains:
        """The same with some terms the other way round; nodes can only come to stand for themselves."""
        kept, source, factor = self.kept.copy(), self.source.copy(), self.factor.copy()
        own = terms[:, 1] == ITSELF
        kept[tuple(terms[~own].T)] ^= True
        source[terms[own, 0]], factor[terms[own, 0]] = terms[own, 0], 1.0
        return Remains(kept, source, factor)

    def standing(self, node: int, source: int, factor: float) -> Remains:
        """The same with a node standing for another one times a factor, or for a number."""
        sources, factors = self.source.copy(), self.factor.copy()
        sources[node], factors[node] = source, factor
        return Remains(self.kept, sources, factors)


class Outputs(NamedTuple):
    """Of a program, but for those that are known to be zero, as most entries of loops' mass matrices are."""

    values: FloatArray
    """(k, n_samples)"""
    places: IntArray
    """Among all outputs, rising, (k,)."""

    @classmethod
    def of(cls, everything: FloatArray) -> Outputs:
        """Of all outputs, (n_outputs, n_samples), but for those that are zero for every sample."""
        places = np.flatnonzero(everything.any(axis=1))
        return cls(everything[places], places)


class Tape:
    """A program whose terms can be left out, and whose nodes can stand for others.

    Args:
        program: Of sums, products, sines, cosines and friction's functions.
    """

    def __init__(self, program: Program) -> None:
        self.program = program
        self.size = len(program.nodes)
        codes, operands, numbers = [], [], []
        for operation, values, number in program.nodes:
            codes.append(CODES[operation])
            operands.append([*values, ZERO, ZERO][:2])
            numbers.append(number)
        self._codes = np.array(codes, dtype=np.int64)
        self._operands = np.array(operands, dtype=np.int64).reshape(-1, 2)
        self._numbers = np.array(numbers)
        self._outputs = np.array(program.outputs, dtype=np.int64)
        zero = [program.nodes[value >> 1] == Node("constant") for value in program.outputs]
        self._live = np.flatnonzero(~np.array(zero, dtype=np.bool_))
        self._signs = np.where(self._outputs[self._live] & 1, -1.0, 1.0)

    def everything(self) -> Remains:
        """The whole program."""
        return Remains(
            np.ones((self.size, 3), dtype=np.bool_), np.arange(self.size), np.ones(self.size)
        )

    def candidates(self) -> IntArray:
        """Terms: numbers of nodes and what of them, (n_candidates, 2).

        All but the last ones can be left out. These are nodes as what they are, which can be put back
        where they stand for others.
        """
        sums = np.flatnonzero(self._codes == SUM)
        whole = np.flatnonzero(self._codes != CONSTANT)
        terms = [
            *((k, side) for k in sums for side in (FIRST, SECOND)),
            *((k, WHOLE) for k in whole),
            *((k, ITSELF) for k in np.flatnonzero(self._codes != INPUT)),
        ]
        return np.array(terms, dtype=np.int64).reshape(-1, 2)

    def made(self) -> BoolArray:
        """Which nodes are computed, neither constants nor inputs, (n_nodes,)."""
        result: BoolArray = self._codes > INPUT
        return result

    def constants(self) -> IntArray:
        """Nodes that are constants, (n_constants,)."""
        return np.flatnonzero(self._codes == CONSTANT)

    def linear(self, n: int) -> BoolArray:
        """Of which nodes the first n inputs are part, (n_nodes,)."""
        result = np.zeros(self.size, dtype=np.bool_)
        for k, (operation, operands, number) in enumerate(self.program.nodes):
            result[k] = (operation == "input" and number < n) or any(
                result[value >> 1] for value in operands
            )
        return result

    def parameters(self, n: int) -> IntArray:
        """Nodes of the first inputs, -1 for those that the program does not use, (n,)."""
        result = np.full(n, NONE)
        inputs = np.flatnonzero(self._codes == INPUT)
        positions = self._numbers[inputs].astype(np.int64)
        first = positions < n
        result[positions[first]] = inputs[first]
        return result

    def needed(self, left: Remains) -> BoolArray:
        """Nodes that outputs are made of, (n_nodes,)."""
        needed: BoolArray = kernels.needed(
            self._codes, self._operands, self._outputs, left.kept, left.source
        )
        return needed

    def values(self, left: Remains, inputs: FloatArray, which: BoolArray) -> FloatArray:
        """Of nodes, (n_nodes, n_samples); zero where they are left out, or not asked for.

        Args:
            left: Of the program.
            inputs: By position, (n_inputs, n_samples).
            which: Nodes that are asked for, with all that they are made of, (n_nodes,).
        """
        values: FloatArray = kernels.values(
            self._codes, self._operands, self._numbers, left.kept, left.source, left.factor,
            inputs, which,
        )  # fmt: skip
        return values

    def outputs(self, values: FloatArray) -> Outputs:
        """Outputs from the values of nodes, (n_nodes, n_samples)."""
        nodes = self._outputs[self._live] >> 1
        return Outputs(values[nodes] * self._signs[:, None], self._live)

    def own_values(self, left: Remains, inputs: FloatArray, values: FloatArray) -> FloatArray:
        """What nodes would be if they were kept as they are, (n_nodes, n_samples).

        Args:
            left: Of the program.
            inputs: By position, (n_inputs, n_samples).
            values: Of all nodes.
        """
        own: FloatArray = kernels.own_values(
            self._codes, self._operands, self._numbers, left.kept, inputs, values
        )
        return own

    def adjoints(
        self, left: Remains, values: FloatArray, seeds: FloatArray, which: BoolArray
    ) -> FloatArray:
        """Derivatives of quantities that are linear in the outputs, by nodes.

        Args:
            left: Of the program.
            values: Of the nodes.
            seeds: Derivatives of the quantities by the outputs, (n_outputs, n_quantities, n_samples).
            which: Nodes that are asked for, with all that is made of them, (n_nodes,).

        Returns:
            Zero for other nodes, (n_nodes, n_quantities, n_samples).
        """
        found, reached = self._adjoints(left, values, seeds, which)
        found[~reached] = 0.0
        return found

    def adjoints_of(
        self,
        left: Remains,
        values: FloatArray,
        seeds: FloatArray,
        which: BoolArray,
        nodes: IntArray,
    ) -> FloatArray:
        """The same for some of the nodes that are asked for, (k, n_quantities, n_samples)."""
        found, reached = self._adjoints(left, values, seeds, which)
        some = found[nodes]
        some[~reached[nodes]] = 0.0
        return some

    def _adjoints(
        self, left: Remains, values: FloatArray, seeds: FloatArray, which: BoolArray
    ) -> tuple[FloatArray, BoolArray]:
        """Anything where there are none."""
        return kernels.adjoints(
            self._codes, self._operands, self._outputs, left.kept, left.source, left.factor,
            values, seeds, which,
        )  # fmt: skip

    def effects(
        self,
        left: Remains,
        candidates: IntArray,
        values: FloatArray,
        own: FloatArray,
        adjoints: FloatArray,
    ) -> FloatArray:
        """What terms give to quantities, to first order, (n_candidates, n_quantities n_samples).

        Terms that are left out get what they would give, nodes that stand for others what they would
        give beyond that as what they are.
        """
        return kernels.effects(
            self._operands, left.kept, left.source, left.factor, candidates, values, own, adjoints
        )

    def combinations(self, left: Remains, terms: IntArray, n: int) -> FloatArray:
        """Linear combinations of the first n inputs that terms are multiples of, (n_terms, n).

        Zero for terms that are no multiple of one, or for which that cannot be seen.
        """
        found, coefficients = kernels.combinations(
            self._codes, self._operands, self._numbers, left.kept, left.source, left.factor, n
        )
        nodes, what = terms.T
        operands = self._operands[nodes, np.minimum(what, SECOND)] >> 1
        node = found[np.where(what == WHOLE, nodes, operands)]
        known = (node >= 0) & (what != ITSELF)
        return np.where(known[:, None], coefficients[node], 0.0)

    def count(self, left: Remains) -> int:
        """Operations left, nearly: sums and products are not rearranged, nor numbers worked out."""
        return int(
            kernels.count(
                self._codes, self._operands, self._outputs, left.kept, left.source, left.factor
            )
        )

    def counts(self, left: Remains, candidates: IntArray) -> IntArray:
        """Operations left when one more term is the other way round, (n_candidates,).

        Nodes that stand for themselves and could only stand for others stay as they are.
        """
        return kernels.counts(
            self._codes, self._operands, self._outputs, left.kept, left.source, left.factor,
            candidates,
        )  # fmt: skip

    def counts_standing(
        self, left: Remains, nodes: IntArray, sources: IntArray, factors: FloatArray
    ) -> IntArray:
        """Operations left when one more node stands for another one, (n_ways,)."""
        return kernels.counts_standing(
            self._codes, self._operands, self._outputs, left.kept, left.source, left.factor,
            nodes, sources, factors,
        )  # fmt: skip

    def rebuilt(self, left: Remains) -> Program:
        """The program that is left."""
        nodes = [Node("constant")]
        stands_for: list[int] = []

        def constant(number: float) -> int:
            nodes.append(Node("constant", (), abs(number)))
            return 2 * (len(nodes) - 1) + (number < 0)

        for k, (operation, operands, number) in enumerate(self.program.nodes):
            source, factor = int(left.source[k]), float(left.factor[k])
            if not left.kept[k, WHOLE]:
                stands_for.append(ZERO)
            elif source == NUMBER:
                stands_for.append(constant(factor))
            elif source != k and abs(factor) == 1.0:
                stands_for.append(stands_for[source] ^ (factor < 0))
            elif source != k:
                nodes.append(Node("*", (constant(factor), stands_for[source])))
                stands_for.append(2 * (len(nodes) - 1))
            else:
                left_out = (operation == "+" and not left.kept[k, s] for s in range(len(operands)))
                nodes.append(
                    Node(
                        operation,
                        tuple(
                            ZERO if out else stands_for[value >> 1] ^ (value & 1)
                            for out, value in zip(left_out, operands, strict=True)
                        ),
                        number,
                    )
                )
                stands_for.append(2 * (len(nodes) - 1))
        outputs = tuple(stands_for[value >> 1] ^ (value & 1) for value in self.program.outputs)
        graph = Graph()
        return Program.of_graph(graph, Program(tuple(nodes), outputs).rebuilt(graph))
