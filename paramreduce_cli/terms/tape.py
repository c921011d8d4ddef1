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
    """Values of the outputs, (k, n_samples)."""
    positions: IntArray
    """Positions among all outputs, ascending, (k,)."""

    @classmethod
    def drop_zero(cls, everything: FloatArray) -> Outputs:
        """Return the outputs, (n_outputs, n_samples), without those that are zero for every sample."""
        positions = np.flatnonzero(everything.any(axis=1))
        return cls(everything[positions], positions)


class Tape:
    """A program whose terms can be removed, and whose nodes can be replaced by multiples of others.

    Args:
        program: Program of sums, products, sines, cosines and friction's functions.
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

    def keep_all(self) -> Pruning:
        """Return the pruning that removes nothing."""
        return Pruning.keep_all(self.size)

    def list_candidates(self) -> IntArray:
        """Return all terms as pairs of node and part, (n_candidates, 2).

        The last ones restore replaced nodes and cannot be removed.
        """
        sums = np.flatnonzero(self._instructions.codes == SUM)
        whole = np.flatnonzero(self._instructions.codes != CONSTANT)
        terms = [
            *((k, side) for k in sums for side in (FIRST, SECOND)),
            *((k, WHOLE) for k in whole),
            *((k, ITSELF) for k in np.flatnonzero(self._instructions.codes != INPUT)),
        ]
        return np.array(terms, dtype=np.int64).reshape(-1, 2)

    def mark_computed(self) -> BoolArray:
        """Return a mask of the nodes that are neither constants nor inputs, (n_nodes,)."""
        result: BoolArray = self._instructions.codes > INPUT
        return result

    def find_constants(self) -> IntArray:
        """Return the nodes that are constants, (n_constants,)."""
        return np.flatnonzero(self._instructions.codes == CONSTANT)

    def mark_dependent(self, n: int) -> BoolArray:
        """Return a mask of the nodes that depend on the first n inputs, (n_nodes,)."""
        result = np.zeros(self.size, dtype=np.bool_)
        for k, (operation, operands, number) in enumerate(self.program.nodes):
            result[k] = (operation == "input" and number < n) or any(
                result[value >> 1] for value in operands
            )
        return result

    def find_parameters(self, n: int) -> IntArray:
        """Return the indices of the nodes of the first n inputs, -1 for inputs that the program does not use, (n,)."""
        result = np.full(n, NONE)
        inputs = np.flatnonzero(self._instructions.codes == INPUT)
        positions = self._instructions.numbers[inputs].astype(np.int64)
        first = positions < n
        result[positions[first]] = inputs[first]
        return result

    def mark_live(self, pruning: Pruning) -> BoolArray:
        """Return a mask of the nodes that outputs depend on, (n_nodes,)."""
        needed: BoolArray = kernels.find_live_nodes(self._instructions, pruning)
        return needed

    def evaluate(self, pruning: Pruning, inputs: FloatArray, which: BoolArray) -> FloatArray:
        """Return the values of nodes, (n_nodes, n_samples); zero for removed and unrequested nodes.

        Args:
            pruning: Pruning of the program.
            inputs: Inputs by position, (n_inputs, n_samples).
            which: Mask of the requested nodes and of everything they depend on, (n_nodes,).
        """
        values: FloatArray = kernels.evaluate(
            self._instructions, pruning,
            inputs, which,
        )  # fmt: skip
        return values

    def get_outputs(self, values: FloatArray) -> Outputs:
        """Return the outputs from the values of nodes, (n_nodes, n_samples)."""
        nodes = self._instructions.outputs[self._live] >> 1
        return Outputs(values[nodes] * self._signs[:, None], self._live)

    def evaluate_unreplaced(
        self, pruning: Pruning, inputs: FloatArray, values: FloatArray
    ) -> FloatArray:
        """Return the values that nodes would have if they were not replaced, (n_nodes, n_samples).

        Args:
            pruning: Pruning of the program.
            inputs: Inputs by position, (n_inputs, n_samples).
            values: Values of all nodes.
        """
        own: FloatArray = kernels.evaluate_unreplaced(self._instructions, pruning, inputs, values)
        return own

    def compute_adjoints(
        self, pruning: Pruning, values: FloatArray, seeds: FloatArray, which: BoolArray
    ) -> FloatArray:
        """Return the derivatives of quantities, which are linear in the outputs, with respect to nodes.

        Args:
            pruning: Pruning of the program.
            values: Values of the nodes.
            seeds: Derivatives of the quantities with respect to the outputs, (n_outputs, n_quantities, n_samples).
            which: Mask of the requested nodes and of everything that depends on them, (n_nodes,).

        Returns:
            Derivatives, (n_nodes, n_quantities, n_samples); zero for other nodes.
        """
        found, reached = self._compute_adjoints(pruning, values, seeds, which)
        found[~reached] = 0.0
        return found

    def compute_adjoints_of(
        self,
        pruning: Pruning,
        values: FloatArray,
        seeds: FloatArray,
        which: BoolArray,
        nodes: IntArray,
    ) -> FloatArray:
        """Return the derivatives with respect to some of the requested nodes, (k, n_quantities, n_samples)."""
        found, reached = self._compute_adjoints(pruning, values, seeds, which)
        some = found[nodes]
        some[~reached[nodes]] = 0.0
        return some

    def _compute_adjoints(
        self, pruning: Pruning, values: FloatArray, seeds: FloatArray, which: BoolArray
    ) -> tuple[FloatArray, BoolArray]:
        """Return derivatives and a mask of the nodes they are valid for; other entries are undefined."""
        return kernels.accumulate_adjoints(
            self._instructions, pruning,
            values, seeds, which,
        )  # fmt: skip

    def estimate_effects(
        self,
        pruning: Pruning,
        candidates: IntArray,
        values: FloatArray,
        kept_values: FloatArray,
        adjoints: FloatArray,
    ) -> FloatArray:
        """Return what terms add to quantities, to first order, (n_candidates, n_quantities * n_samples).

        For removed terms this is the effect of restoring them; for candidates that restore a replaced node, that of the
        node's own value instead of the substitute.
        """
        return kernels.compute_effects(
            self._instructions, pruning, candidates, values, kept_values, adjoints
        )

    def find_combinations(self, pruning: Pruning, terms: IntArray, n: int) -> FloatArray:
        """Return the linear combinations of the first n inputs that terms are multiples of, (n_terms, n); zero for
        terms of another form.
        """
        found, coefficients = kernels.find_combinations(self._instructions, pruning, n)
        nodes, what = terms.T
        operands = self._instructions.operands[nodes, np.minimum(what, SECOND)] >> 1
        node = found[np.where(what == WHOLE, nodes, operands)]
        known = (node >= 0) & (what != ITSELF)
        return np.where(known[:, None], coefficients[node], 0.0)

    def count_operations(self, pruning: Pruning) -> int:
        """Return the approximate number of operations: sums and products are not rearranged, numbers are not combined."""
        return int(kernels.count_operations(self._instructions, pruning))

    def count_flipped(self, pruning: Pruning, candidates: IntArray) -> IntArray:
        """Return the number of operations after flipping each candidate, (n_candidates,).

        Candidates that restore a node which is not replaced change nothing.
        """
        return kernels.count_flipped(
            self._instructions, pruning,
            candidates,
        )  # fmt: skip

    def count_replaced(
        self, pruning: Pruning, nodes: IntArray, sources: IntArray, factors: FloatArray
    ) -> IntArray:
        """Return the number of operations after replacing one more node by a multiple of another, (n_replacements,)."""
        return kernels.count_replaced(
            self._instructions, pruning,
            nodes, sources, factors,
        )  # fmt: skip

    def rebuild(self, pruning: Pruning) -> Program:
        """Return the pruned program."""
        nodes = [Node("constant")]
        stands_for: list[int] = []

        def constant(number: float) -> int:
            """Append a constant, and return the reference to it."""
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
