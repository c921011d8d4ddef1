"""A program in arrays, of which terms can be left out: values, derivatives and operations, by Numba.

A term is an operand of a sum, or a node as a whole, which then is zero wherever it is used. Instead
a node may stand for another one times a factor, or for a number. Programs are linear in their
parameters, which are their first inputs, and stay so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from paramreduce_cli.expressions.graph import ZERO, Graph, Node
from paramreduce_cli.expressions.operations import Program
from paramreduce_cli.records import BoolArray, FloatArray, IntArray

_CONSTANT, _INPUT, _SUM, _PRODUCT, _SIN, _COS, _TANH, _SIGN = range(8)
_CODES = {
    "constant": _CONSTANT, "input": _INPUT, "+": _SUM, "*": _PRODUCT,
    "sin": _SIN, "cos": _COS, "tanh": _TANH, "sign": _SIGN,
}  # fmt: skip
_NONE = -1
_FIRST, _SECOND, WHOLE, ITSELF = range(4)
"""What of a node can be otherwise: its operands in a sum, whether it is zero, what it stands for."""
NUMBER = -1
"""What a node stands for that is a number."""


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
            codes.append(_CODES[operation])
            operands.append([*values, ZERO, ZERO][:2])
            numbers.append(number)
        self._codes = np.array(codes, dtype=np.int64)
        self._operands = np.array(operands, dtype=np.int64).reshape(-1, 2)
        self._numbers = np.array(numbers)
        self._outputs = np.array(program.outputs, dtype=np.int64)

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
        sums = np.flatnonzero(self._codes == _SUM)
        whole = np.flatnonzero(self._codes != _CONSTANT)
        terms = [
            *((k, side) for k in sums for side in (_FIRST, _SECOND)),
            *((k, WHOLE) for k in whole),
            *((k, ITSELF) for k in np.flatnonzero(self.made())),
        ]
        return np.array(terms, dtype=np.int64).reshape(-1, 2)

    def made(self) -> BoolArray:
        """Which nodes are computed, neither constants nor inputs, (n_nodes,)."""
        result: BoolArray = self._codes > _INPUT
        return result

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
        result = np.full(n, _NONE)
        inputs = np.flatnonzero(self._codes == _INPUT)
        positions = self._numbers[inputs].astype(np.int64)
        first = positions < n
        result[positions[first]] = inputs[first]
        return result

    def needed(self, left: Remains) -> BoolArray:
        """Nodes that outputs are made of, (n_nodes,)."""
        needed: BoolArray = _needed(
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
        values: FloatArray = _values(
            self._codes, self._operands, self._numbers, left.kept, left.source, left.factor,
            inputs, which,
        )  # fmt: skip
        return values

    def own_values(self, left: Remains, inputs: FloatArray, values: FloatArray) -> FloatArray:
        """What nodes would be if they were kept as they are, (n_nodes, n_samples).

        Args:
            left: Of the program.
            inputs: By position, (n_inputs, n_samples).
            values: Of all nodes.
        """
        own: FloatArray = _own_values(
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
        return _adjoints(
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
        return _effects(
            self._operands, left.kept, left.source, left.factor, candidates, values, own, adjoints
        )

    def count(self, left: Remains) -> int:
        """Operations left, nearly: sums and products are not rearranged, nor numbers worked out."""
        return int(
            _count(self._codes, self._operands, self._outputs, left.kept, left.source, left.factor)
        )

    def counts(self, left: Remains, candidates: IntArray) -> IntArray:
        """Operations left when one more term is the other way round, (n_candidates,).

        Nodes that stand for themselves and could only stand for others stay as they are.
        """
        return _counts(
            self._codes, self._operands, self._outputs, left.kept, left.source, left.factor,
            candidates,
        )  # fmt: skip

    def counts_standing(
        self, left: Remains, nodes: IntArray, sources: IntArray, factors: FloatArray
    ) -> IntArray:
        """Operations left when one more node stands for another one, (n_ways,)."""
        return _counts_standing(
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


@numba.njit(cache=True, nogil=True)
def _needed(
    codes: IntArray, operands: IntArray, outputs: IntArray, kept: BoolArray, source: IntArray
) -> BoolArray:
    needed = np.zeros(codes.size, dtype=np.bool_)
    for value in outputs:
        needed[value >> 1] = True
    for k in range(codes.size - 1, -1, -1):
        code = codes[k]
        if not needed[k] or code <= _INPUT or not kept[k, WHOLE] or source[k] == NUMBER:
            continue
        if source[k] != k:
            needed[source[k]] = True
            continue
        if code != _SUM or kept[k, _FIRST]:
            needed[operands[k, 0] >> 1] = True
        if code == _PRODUCT or (code == _SUM and kept[k, _SECOND]):
            needed[operands[k, 1] >> 1] = True
    return needed


@numba.njit(cache=True, nogil=True)
def _made(
    k: int,
    codes: IntArray,
    operands: IntArray,
    numbers: FloatArray,
    kept: BoolArray,
    inputs: FloatArray,
    v: FloatArray,
    result: FloatArray,
) -> None:
    """What node k makes of its operands."""
    code, m = codes[k], inputs.shape[1]
    a, b = operands[k, 0] >> 1, operands[k, 1] >> 1
    s = -1.0 if operands[k, 0] & 1 else 1.0
    t = -1.0 if operands[k, 1] & 1 else 1.0
    if code == _CONSTANT:
        result[:] = numbers[k]
    elif code == _INPUT:
        result[:] = inputs[int(numbers[k])]
    elif code == _SUM:
        if not kept[k, _FIRST]:
            s = 0.0
        if not kept[k, _SECOND]:
            t = 0.0
        for i in range(m):
            result[i] = s * v[a, i] + t * v[b, i]
    elif code == _PRODUCT:
        for i in range(m):
            result[i] = s * t * v[a, i] * v[b, i]
    else:
        for i in range(m):
            x = s * v[a, i]
            if code == _SIN:
                result[i] = np.sin(x)
            elif code == _COS:
                result[i] = np.cos(x)
            elif code == _TANH:
                result[i] = np.tanh(x)
            else:
                result[i] = np.sign(x)


@numba.njit(cache=True, nogil=True)
def _values(
    codes: IntArray,
    operands: IntArray,
    numbers: FloatArray,
    kept: BoolArray,
    source: IntArray,
    factor: FloatArray,
    inputs: FloatArray,
    which: BoolArray,
) -> FloatArray:
    v = np.zeros((codes.size, inputs.shape[1]))
    for k in range(codes.size):
        if not which[k] or not kept[k, WHOLE]:
            continue
        if source[k] == k:
            _made(k, codes, operands, numbers, kept, inputs, v, v[k])
        elif source[k] == NUMBER:
            v[k] = factor[k]
        else:
            for i in range(v.shape[1]):
                v[k, i] = factor[k] * v[source[k], i]
    return v


@numba.njit(cache=True, nogil=True)
def _own_values(
    codes: IntArray,
    operands: IntArray,
    numbers: FloatArray,
    kept: BoolArray,
    inputs: FloatArray,
    v: FloatArray,
) -> FloatArray:
    own = np.empty(v.shape)
    for k in range(codes.size):
        _made(k, codes, operands, numbers, kept, inputs, v, own[k])
    return own


@numba.njit(cache=True, nogil=True)
def _adjoints(
    codes: IntArray,
    operands: IntArray,
    outputs: IntArray,
    kept: BoolArray,
    source: IntArray,
    factor: FloatArray,
    v: FloatArray,
    seeds: FloatArray,
    which: BoolArray,
) -> FloatArray:
    n, quantities, m = codes.size, seeds.shape[1], v.shape[1]
    adjoints = np.zeros((n, quantities, m))
    reached = np.zeros((n, quantities), dtype=np.bool_)
    for o in range(outputs.size):
        k = outputs[o] >> 1
        if not which[k]:
            continue
        s = -1.0 if outputs[o] & 1 else 1.0
        for q in range(quantities):
            if np.any(seeds[o, q]):
                reached[k, q] = True
                for i in range(m):
                    adjoints[k, q, i] += s * seeds[o, q, i]
    for k in range(n - 1, -1, -1):
        code = codes[k]
        if not which[k] or code <= _INPUT or not kept[k, WHOLE] or source[k] == NUMBER:
            continue
        a, b = operands[k, 0] >> 1, operands[k, 1] >> 1
        s = -1.0 if operands[k, 0] & 1 else 1.0
        t = -1.0 if operands[k, 1] & 1 else 1.0
        for q in range(quantities):
            if not reached[k, q]:
                continue
            if source[k] != k:
                reached[source[k], q] = True
                for i in range(m):
                    adjoints[source[k], q, i] += factor[k] * adjoints[k, q, i]
            elif code == _SUM:
                if kept[k, _FIRST] and which[a]:
                    reached[a, q] = True
                    for i in range(m):
                        adjoints[a, q, i] += s * adjoints[k, q, i]
                if kept[k, _SECOND] and which[b]:
                    reached[b, q] = True
                    for i in range(m):
                        adjoints[b, q, i] += t * adjoints[k, q, i]
            elif code == _PRODUCT:
                if which[a]:
                    reached[a, q] = True
                    for i in range(m):
                        adjoints[a, q, i] += s * t * adjoints[k, q, i] * v[b, i]
                if which[b]:
                    reached[b, q] = True
                    for i in range(m):
                        adjoints[b, q, i] += s * t * adjoints[k, q, i] * v[a, i]
            elif code != _SIGN and which[a]:
                reached[a, q] = True
                for i in range(m):
                    x = s * v[a, i]
                    if code == _SIN:
                        slope = np.cos(x)
                    elif code == _COS:
                        slope = -np.sin(x)
                    else:
                        slope = 1.0 - v[k, i] ** 2
                    adjoints[a, q, i] += s * slope * adjoints[k, q, i]
    return adjoints


@numba.njit(cache=True, nogil=True)
def _effects(
    operands: IntArray,
    kept: BoolArray,
    source: IntArray,
    factor: FloatArray,
    candidates: IntArray,
    v: FloatArray,
    own: FloatArray,
    adjoints: FloatArray,
) -> FloatArray:
    _, quantities, m = adjoints.shape
    result = np.empty((candidates.shape[0], quantities * m))
    given = np.empty(m)
    for c in range(candidates.shape[0]):
        k, what = candidates[c]
        # Terms of nodes that are left out, or stand for others, give nothing.
        given[:] = 0.0
        if what == WHOLE:
            if source[k] == k:
                given[:] = own[k]
            elif source[k] == NUMBER:
                given[:] = factor[k]
            else:
                given[:] = factor[k] * v[source[k]]
        elif what == ITSELF:
            if kept[k, WHOLE]:
                given[:] = own[k] - v[k]
        elif kept[k, WHOLE] and source[k] == k:
            given[:] = v[operands[k, what] >> 1]
            if operands[k, what] & 1:
                given *= -1.0
        for q in range(quantities):
            for i in range(m):
                result[c, q * m + i] = adjoints[k, q, i] * given[i]
    return result


@numba.njit(cache=True, nogil=True)
def _count(
    codes: IntArray,
    operands: IntArray,
    outputs: IntArray,
    kept: BoolArray,
    source: IntArray,
    factor: FloatArray,
) -> int:
    n = codes.size
    stands_for = np.arange(n)
    for k in range(n):
        code = codes[k]
        if not kept[k, WHOLE]:
            stands_for[k] = _NONE
        elif source[k] == NUMBER:
            continue
        elif source[k] != k:
            j = stands_for[source[k]]
            if j == _NONE or np.abs(factor[k]) == 1.0:
                stands_for[k] = j
        elif code > _INPUT:
            a, b = stands_for[operands[k, 0] >> 1], stands_for[operands[k, 1] >> 1]
            if code == _SUM:
                if not kept[k, _FIRST]:
                    a = _NONE
                if not kept[k, _SECOND]:
                    b = _NONE
                if a == _NONE:
                    stands_for[k] = b
                elif b == _NONE:
                    stands_for[k] = a
            elif code == _PRODUCT:
                if a == _NONE or b == _NONE:
                    stands_for[k] = _NONE
            elif a == _NONE and code != _COS:
                stands_for[k] = _NONE
    needed = np.zeros(n, dtype=np.bool_)
    for value in outputs:
        node = stands_for[value >> 1]
        if node != _NONE:
            needed[node] = True
    count = 0
    for k in range(n - 1, -1, -1):
        if not needed[k] or codes[k] <= _INPUT or source[k] == NUMBER:
            continue
        count += 1
        if source[k] != k:
            needed[stands_for[source[k]]] = True
            continue
        sides = 2 if codes[k] <= _PRODUCT else 1
        for side in range(sides):
            node = stands_for[operands[k, side] >> 1]
            if node != _NONE:
                needed[node] = True
    return count


@numba.njit(cache=True, nogil=True)
def _counts(
    codes: IntArray,
    operands: IntArray,
    outputs: IntArray,
    kept: BoolArray,
    source: IntArray,
    factor: FloatArray,
    candidates: IntArray,
) -> IntArray:
    result = np.empty(candidates.shape[0], dtype=np.int64)
    changed, sources = kept.copy(), source.copy()
    for c in range(candidates.shape[0]):
        k, what = candidates[c]
        if what == ITSELF:
            sources[k] = k
        else:
            changed[k, what] = not changed[k, what]
        result[c] = _count(codes, operands, outputs, changed, sources, factor)
        if what == ITSELF:
            sources[k] = source[k]
        else:
            changed[k, what] = not changed[k, what]
    return result


@numba.njit(cache=True, nogil=True)
def _counts_standing(
    codes: IntArray,
    operands: IntArray,
    outputs: IntArray,
    kept: BoolArray,
    source: IntArray,
    factor: FloatArray,
    nodes: IntArray,
    standing_for: IntArray,
    times: FloatArray,
) -> IntArray:
    result = np.empty(nodes.size, dtype=np.int64)
    sources, factors = source.copy(), factor.copy()
    for c in range(nodes.size):
        k = nodes[c]
        sources[k], factors[k] = standing_for[c], times[c]
        result[c] = _count(codes, operands, outputs, kept, sources, factors)
        sources[k], factors[k] = source[k], factor[k]
    return result
