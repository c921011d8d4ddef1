"""A program in arrays, of which terms can be left out: values, derivatives and operations, by Numba.

A term is an operand of a sum, or a node as a whole, which then is zero wherever it is used.
Programs are linear in their parameters, which are their first inputs, and stay so.
"""

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


class Tape:
    """A program whose terms can be left out.

    What is left out is said by a mask: of every node whether its first and its second operand are
    kept, which matters to sums, and whether it is kept itself, (n_nodes, 3).

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

    def everything(self) -> BoolArray:
        """The mask that leaves nothing out."""
        return np.ones((self.size, 3), dtype=np.bool_)

    def candidates(self) -> IntArray:
        """Terms that can be left out: numbers of nodes and what of them, (n_candidates, 2)."""
        sums = np.flatnonzero(self._codes == _SUM)
        whole = np.flatnonzero(self._codes != _CONSTANT)
        terms = [*((k, side) for k in sums for side in (0, 1)), *((k, 2) for k in whole)]
        return np.array(terms, dtype=np.int64).reshape(-1, 2)

    def parameters(self, n: int) -> IntArray:
        """Nodes of the first inputs, -1 for those that the program does not use, (n,)."""
        result = np.full(n, _NONE)
        inputs = np.flatnonzero(self._codes == _INPUT)
        positions = self._numbers[inputs].astype(np.int64)
        first = positions < n
        result[positions[first]] = inputs[first]
        return result

    def values(self, mask: BoolArray, inputs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Of all nodes, and what they would be if they were kept, each (n_nodes, n_samples).

        Args:
            mask: What is kept.
            inputs: By position, (n_inputs, n_samples).
        """
        return _values(self._codes, self._operands, self._numbers, mask, inputs)

    def adjoints(self, mask: BoolArray, values: FloatArray, seeds: FloatArray) -> FloatArray:
        """Derivatives of quantities that are linear in the outputs, by all nodes.

        Args:
            mask: What is kept.
            values: Of the nodes.
            seeds: Derivatives of the quantities by the outputs, (n_outputs, n_quantities, n_samples).

        Returns:
            (n_nodes, n_quantities, n_samples)
        """
        return _adjoints(self._codes, self._operands, self._outputs, mask, values, seeds)

    def effects(
        self, candidates: IntArray, values: FloatArray, own: FloatArray, adjoints: FloatArray
    ) -> FloatArray:
        """What terms give to quantities, to first order, (n_candidates, n_quantities n_samples).

        Terms that are left out get what they would give.
        """
        return _effects(self._operands, candidates, values, own, adjoints)

    def count(self, mask: BoolArray) -> int:
        """Operations left, nearly: sums and products are not rearranged."""
        return int(_count(self._codes, self._operands, self._outputs, mask))

    def counts(self, mask: BoolArray, candidates: IntArray) -> IntArray:
        """Operations left when one more term is the other way round, (n_candidates,)."""
        return _counts(self._codes, self._operands, self._outputs, mask, candidates)

    def rebuilt(self, mask: BoolArray) -> Program:
        """The program that is left."""
        # Node 0 is zero, which left-out operands refer to; all others move up by one.
        nodes = [Node("constant")]
        for k, (operation, operands, number) in enumerate(self.program.nodes):
            left_out = (operation == "+" and not mask[k, side] for side in range(len(operands)))
            kept = tuple(
                ZERO if out else value + 2 for out, value in zip(left_out, operands, strict=True)
            )
            nodes.append(Node(operation, kept, number) if mask[k, 2] else Node("constant"))
        whole = Program(tuple(nodes), tuple(value + 2 for value in self.program.outputs))
        graph = Graph()
        return Program.of_graph(graph, whole.rebuilt(graph))


@numba.njit(cache=True, nogil=True)
def _values(
    codes: IntArray, operands: IntArray, numbers: FloatArray, mask: BoolArray, inputs: FloatArray
) -> tuple[FloatArray, FloatArray]:
    n, m = codes.size, inputs.shape[1]
    v, own = np.zeros((n, m)), np.empty((n, m))
    for k in range(n):
        if k > 0 and mask[k - 1, 2]:
            v[k - 1] = own[k - 1]
        code = codes[k]
        if code == _CONSTANT:
            own[k] = numbers[k]
            continue
        if code == _INPUT:
            own[k] = inputs[int(numbers[k])]
            continue
        a, b = operands[k, 0] >> 1, operands[k, 1] >> 1
        s = -1.0 if operands[k, 0] & 1 else 1.0
        t = -1.0 if operands[k, 1] & 1 else 1.0
        if code == _SUM:
            if not mask[k, 0]:
                s = 0.0
            if not mask[k, 1]:
                t = 0.0
            for i in range(m):
                own[k, i] = s * v[a, i] + t * v[b, i]
        elif code == _PRODUCT:
            for i in range(m):
                own[k, i] = s * t * v[a, i] * v[b, i]
        else:
            for i in range(m):
                x = s * v[a, i]
                if code == _SIN:
                    own[k, i] = np.sin(x)
                elif code == _COS:
                    own[k, i] = np.cos(x)
                elif code == _TANH:
                    own[k, i] = np.tanh(x)
                else:
                    own[k, i] = np.sign(x)
    if mask[n - 1, 2]:
        v[n - 1] = own[n - 1]
    return v, own


@numba.njit(cache=True, nogil=True)
def _adjoints(
    codes: IntArray,
    operands: IntArray,
    outputs: IntArray,
    mask: BoolArray,
    v: FloatArray,
    seeds: FloatArray,
) -> FloatArray:
    n, quantities, m = codes.size, seeds.shape[1], v.shape[1]
    adjoints = np.zeros((n, quantities, m))
    reached = np.zeros((n, quantities), dtype=np.bool_)
    for o in range(outputs.size):
        k = outputs[o] >> 1
        s = -1.0 if outputs[o] & 1 else 1.0
        for q in range(quantities):
            if np.any(seeds[o, q]):
                reached[k, q] = True
                for i in range(m):
                    adjoints[k, q, i] += s * seeds[o, q, i]
    for k in range(n - 1, -1, -1):
        code = codes[k]
        if code <= _INPUT or not mask[k, 2]:
            continue
        a, b = operands[k, 0] >> 1, operands[k, 1] >> 1
        s = -1.0 if operands[k, 0] & 1 else 1.0
        t = -1.0 if operands[k, 1] & 1 else 1.0
        for q in range(quantities):
            if not reached[k, q]:
                continue
            if code == _SUM:
                if mask[k, 0]:
                    reached[a, q] = True
                    for i in range(m):
                        adjoints[a, q, i] += s * adjoints[k, q, i]
                if mask[k, 1]:
                    reached[b, q] = True
                    for i in range(m):
                        adjoints[b, q, i] += t * adjoints[k, q, i]
            elif code == _PRODUCT:
                reached[a, q] = reached[b, q] = True
                for i in range(m):
                    adjoints[a, q, i] += s * t * adjoints[k, q, i] * v[b, i]
                    adjoints[b, q, i] += s * t * adjoints[k, q, i] * v[a, i]
            elif code != _SIGN:
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
    operands: IntArray, candidates: IntArray, v: FloatArray, own: FloatArray, adjoints: FloatArray
) -> FloatArray:
    _, quantities, m = adjoints.shape
    result = np.empty((candidates.shape[0], quantities * m))
    for c in range(candidates.shape[0]):
        k, what = candidates[c]
        node, s = k, 1.0
        if what < 2:
            node = operands[k, what] >> 1
            s = -1.0 if operands[k, what] & 1 else 1.0
        source = v if what < 2 else own
        for q in range(quantities):
            for i in range(m):
                result[c, q * m + i] = s * adjoints[k, q, i] * source[node, i]
    return result


@numba.njit(cache=True, nogil=True)
def _count(codes: IntArray, operands: IntArray, outputs: IntArray, mask: BoolArray) -> int:
    n = codes.size
    stands_for = np.arange(n)
    for k in range(n):
        code = codes[k]
        if not mask[k, 2]:
            stands_for[k] = _NONE
        elif code > _INPUT:
            a, b = stands_for[operands[k, 0] >> 1], stands_for[operands[k, 1] >> 1]
            if code == _SUM:
                if not mask[k, 0]:
                    a = _NONE
                if not mask[k, 1]:
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
        if not needed[k] or codes[k] <= _INPUT:
            continue
        count += 1
        sides = 2 if codes[k] <= _PRODUCT else 1
        for side in range(sides):
            node = stands_for[operands[k, side] >> 1]
            if node != _NONE:
                needed[node] = True
    return count


@numba.njit(cache=True, nogil=True)
def _counts(
    codes: IntArray, operands: IntArray, outputs: IntArray, mask: BoolArray, candidates: IntArray
) -> IntArray:
    result = np.empty(candidates.shape[0], dtype=np.int64)
    changed = mask.copy()
    for c in range(candidates.shape[0]):
        k, what = candidates[c]
        changed[k, what] = not changed[k, what]
        result[c] = _count(codes, operands, outputs, changed)
        changed[k, what] = not changed[k, what]
    return result
