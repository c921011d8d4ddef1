"""A program in arrays, of which terms can be left out: values, derivatives and operations.

A term is an operand of a sum, or a node as a whole, which then is zero wherever it is used. Instead
a node may stand for another one times a factor, or for a number. Programs are linear in their
parameters, which are their first inputs, and stay so.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paramreduce_cli.expressions.graph import ZERO, Graph, Node
from paramreduce_cli.expressions.programs import Program
from paramreduce_cli.records import BoolArray, FloatArray, IntArray
from paramreduce_cli.terms import kernels
from paramreduce_cli.terms.kernels import CODES, CONSTANT, INPUT, NONE, SUM
from paramreduce_cli.terms.pruning import (
    FIRST,
    ITSELF,
    NUMBER,
    SECOND,
    WHOLE,
    Instructions,
    Pruning,
)


class Outputs(NamedTuple):
    """The outputs of a program without those that are always zero, as most entries of loops' mass matrices are."""

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
        self._instructions = Instructions(
            codes=np.array(codes, dtype=np.int64),
            operands=np.array(operands, dtype=np.int64).reshape(-1, 2),
            numbers=np.array(numbers),
            outputs=np.array(program.outputs, dtype=np.int64),
        )
        zero = [program.nodes[value >> 1] == Node("constant") for value in program.outputs]
        self._live = np.flatnonzero(~np.array(zero, dtype=np.bool_))
        self._signs = np.where(self._instructions.outputs[self._live] & 1, -1.0, 1.0)

    def everything(self) -> Pruning:
        """The whole program."""
        return Pruning.keep_all(self.size)

    def candidates(self) -> IntArray:
        """Terms: numbers of nodes and what of them, (n_candidates, 2).

        All but the last ones can be left out. These are nodes as what they are, which can be put back
        where they stand for others.
        """
        sums = np.flatnonzero(self._instructions.codes == SUM)
        whole = np.flatnonzero(self._instructions.codes != CONSTANT)
        terms = [
            *((k, side) for k in sums for side in (FIRST, SECOND)),
            *((k, WHOLE) for k in whole),
            *((k, ITSELF) for k in np.flatnonzero(self._instructions.codes != INPUT)),
        ]
        return np.array(terms, dtype=np.int64).reshape(-1, 2)

    def made(self) -> BoolArray:
        """Which nodes are computed, neither constants nor inputs, (n_nodes,)."""
        result: BoolArray = self._instructions.codes > INPUT
        return result

    def constants(self) -> IntArray:
        """Nodes that are constants, (n_constants,)."""
        return np.flatnonzero(self._instructions.codes == CONSTANT)

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
        inputs = np.flatnonzero(self._instructions.codes == INPUT)
        positions = self._instructions.numbers[inputs].astype(np.int64)
        first = positions < n
        result[positions[first]] = inputs[first]
        return result

    def needed(self, pruning: Pruning) -> BoolArray:
        """Nodes that outputs are made of, (n_nodes,)."""
        needed: BoolArray = kernels.find_live_nodes(self._instructions, pruning)
        return needed

    def values(self, pruning: Pruning, inputs: FloatArray, which: BoolArray) -> FloatArray:
        """Of nodes, (n_nodes, n_samples); zero where they are left out, or not asked for.

        Args:
            pruning: Pruning of the program.
            inputs: By position, (n_inputs, n_samples).
            which: Nodes that are asked for, with all that they are made of, (n_nodes,).
        """
        values: FloatArray = kernels.evaluate(
            self._instructions, pruning,
            inputs, which,
        )  # fmt: skip
        return values

    def outputs(self, values: FloatArray) -> Outputs:
        """Outputs from the values of nodes, (n_nodes, n_samples)."""
        nodes = self._instructions.outputs[self._live] >> 1
        return Outputs(values[nodes] * self._signs[:, None], self._live)

    def own_values(self, pruning: Pruning, inputs: FloatArray, values: FloatArray) -> FloatArray:
        """What nodes would be if they were kept as they are, (n_nodes, n_samples).

        Args:
            pruning: Pruning of the program.
            inputs: By position, (n_inputs, n_samples).
            values: Of all nodes.
        """
        own: FloatArray = kernels.evaluate_unreplaced(self._instructions, pruning, inputs, values)
        return own

    def adjoints(
        self, pruning: Pruning, values: FloatArray, seeds: FloatArray, which: BoolArray
    ) -> FloatArray:
        """Derivatives of quantities that are linear in the outputs, by nodes.

        Args:
            pruning: Pruning of the program.
            values: Of the nodes.
            seeds: Derivatives of the quantities by the outputs, (n_outputs, n_quantities, n_samples).
            which: Nodes that are asked for, with all that is made of them, (n_nodes,).

        Returns:
            Zero for other nodes, (n_nodes, n_quantities, n_samples).
        """
        found, reached = self._adjoints(pruning, values, seeds, which)
        found[~reached] = 0.0
        return found

    def adjoints_of(
        self,
        pruning: Pruning,
        values: FloatArray,
        seeds: FloatArray,
        which: BoolArray,
        nodes: IntArray,
    ) -> FloatArray:
        """The same for some of the nodes that are asked for, (k, n_quantities, n_samples)."""
        found, reached = self._adjoints(pruning, values, seeds, which)
        some = found[nodes]
        some[~reached[nodes]] = 0.0
        return some

    def _adjoints(
        self, pruning: Pruning, values: FloatArray, seeds: FloatArray, which: BoolArray
    ) -> tuple[FloatArray, BoolArray]:
        """Anything where there are none."""
        return kernels.accumulate_adjoints(
            self._instructions, pruning,
            values, seeds, which,
        )  # fmt: skip

    def effects(
        self,
        pruning: Pruning,
        candidates: IntArray,
        values: FloatArray,
        own: FloatArray,
        adjoints: FloatArray,
    ) -> FloatArray:
        """What terms give to quantities, to first order, (n_candidates, n_quantities n_samples).

        Terms that are left out get what they would give, nodes that stand for others what they would
        give beyond that as what they are.
        """
        return kernels.compute_effects(
            self._instructions, pruning, candidates, values, own, adjoints
        )

    def combinations(self, pruning: Pruning, terms: IntArray, n: int) -> FloatArray:
        """Linear combinations of the first n inputs that terms are multiples of, (n_terms, n).

        Zero for terms that are no multiple of one, or for which that cannot be seen.
        """
        found, coefficients = kernels.find_combinations(self._instructions, pruning, n)
        nodes, what = terms.T
        operands = self._instructions.operands[nodes, np.minimum(what, SECOND)] >> 1
        node = found[np.where(what == WHOLE, nodes, operands)]
        known = (node >= 0) & (what != ITSELF)
        return np.where(known[:, None], coefficients[node], 0.0)

    def count(self, pruning: Pruning) -> int:
        """Operations left, nearly: sums and products are not rearranged, nor numbers worked out."""
        return int(kernels.count_operations(self._instructions, pruning))

    def counts(self, pruning: Pruning, candidates: IntArray) -> IntArray:
        """Operations left when one more term is the other way round, (n_candidates,).

        Nodes that stand for themselves and could only stand for others stay as they are.
        """
        return kernels.count_flipped(
            self._instructions, pruning,
            candidates,
        )  # fmt: skip

    def counts_standing(
        self, pruning: Pruning, nodes: IntArray, sources: IntArray, factors: FloatArray
    ) -> IntArray:
        """Operations left when one more node stands for another one, (n_ways,)."""
        return kernels.count_replaced(
            self._instructions, pruning,
            nodes, sources, factors,
        )  # fmt: skip

    def rebuilt(self, pruning: Pruning) -> Program:
        """The program that is left."""
        nodes = [Node("constant")]
        stands_for: list[int] = []

        def constant(number: float) -> int:
            nodes.append(Node("constant", (), abs(number)))
            return 2 * (len(nodes) - 1) + (number < 0)

        for k, (operation, operands, number) in enumerate(self.program.nodes):
            source, factor = int(pruning.source[k]), float(pruning.factor[k])
            if not pruning.kept[k, WHOLE]:
                stands_for.append(ZERO)
            elif source == NUMBER:
                stands_for.append(constant(factor))
            elif source != k and abs(factor) == 1.0:
                stands_for.append(stands_for[source] ^ (factor < 0))
            elif source != k:
                nodes.append(Node("*", (constant(factor), stands_for[source])))
                stands_for.append(2 * (len(nodes) - 1))
            else:
                left_out = (
                    operation == "+" and not pruning.kept[k, s] for s in range(len(operands))
                )
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
        return Program.from_graph(graph, Program(tuple(nodes), outputs).rebuild(graph))
