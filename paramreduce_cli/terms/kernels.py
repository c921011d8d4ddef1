"""Kernels of :class:`paramreduce_cli.terms.tape.Tape`, compiled by Numba.

Each takes the program before pruning, and the pruning.
"""

from __future__ import annotations

import numpy as np

from paramreduce_cli.expressions.loops import compile_loop, inline
from paramreduce_cli.records import BoolArray, FloatArray, IntArray
from paramreduce_cli.terms.pruning import (
    FIRST,
    ITSELF,
    NUMBER,
    SECOND,
    WHOLE,
    Instructions,
    Pruning,
)

CONSTANT, INPUT, SUM, PRODUCT, SIN, COS, TANH, SIGN = range(8)
CODES = {
    "constant": CONSTANT, "input": INPUT, "+": SUM, "*": PRODUCT,
    "sin": SIN, "cos": COS, "tanh": TANH, "sign": SIGN,
}  # fmt: skip
NONE = -1
SEVERAL = -2
"""Several in place of a number where there is more than one."""


@compile_loop()
def find_live_nodes(program: Instructions, pruning: Pruning) -> BoolArray:
    """Return the nodes that the outputs depend on, (n_nodes,)."""
    codes, operands = program.codes, program.operands
    kept, source = pruning.kept, pruning.source
    used = np.zeros(codes.size, dtype=np.bool_)
    for value in program.outputs:
        used[value >> 1] = True
    for k in range(codes.size - 1, -1, -1):
        code = codes[k]
        if not used[k] or code <= INPUT or not kept[k, WHOLE] or source[k] == NUMBER:
            continue
        if source[k] != k:
            used[source[k]] = True
            continue
        if code != SUM or kept[k, FIRST]:
            used[operands[k, 0] >> 1] = True
        if code == PRODUCT or (code == SUM and kept[k, SECOND]):
            used[operands[k, 1] >> 1] = True
    return used


@inline
def _multiply(factor: float, values: FloatArray, result: FloatArray) -> None:
    """Write a vector times a factor; a loop, because assigning whole arrays takes Numba seconds to compile."""
    for i in range(result.size):
        result[i] = factor * values[i]


@compile_loop(within=True)
def _evaluate_node(
    k: int,
    program: Instructions,
    pruning: Pruning,
    inputs: FloatArray,
    v: FloatArray,
    result: FloatArray,
) -> None:
    """Write the value of node k, computed from its operands."""
    codes, operands = program.codes, program.operands
    numbers, kept = program.numbers, pruning.kept
    code, m = codes[k], inputs.shape[1]
    a, b = operands[k, 0] >> 1, operands[k, 1] >> 1
    s = -1.0 if operands[k, 0] & 1 else 1.0
    t = -1.0 if operands[k, 1] & 1 else 1.0
    if code == CONSTANT:
        result[:] = numbers[k]
    elif code == INPUT:
        _multiply(1.0, inputs[int(numbers[k])], result)
    elif code == SUM:
        if not kept[k, FIRST]:
            s = 0.0
        if not kept[k, SECOND]:
            t = 0.0
        for i in range(m):
            result[i] = s * v[a, i] + t * v[b, i]
    elif code == PRODUCT:
        for i in range(m):
            result[i] = s * t * v[a, i] * v[b, i]
    else:
        for i in range(m):
            x = s * v[a, i]
            if code == SIN:
                result[i] = np.sin(x)
            elif code == COS:
                result[i] = np.cos(x)
            elif code == TANH:
                result[i] = np.tanh(x)
            else:
                result[i] = np.sign(x)


@compile_loop()
def evaluate(
    program: Instructions, pruning: Pruning, inputs: FloatArray, which: BoolArray
) -> FloatArray:
    """Return the values of the requested nodes, zero for others, (n_nodes, n_samples)."""
    kept, source, factor = pruning
    v = np.zeros((program.codes.size, inputs.shape[1]))
    for k in range(program.codes.size):
        if not which[k] or not kept[k, WHOLE]:
            continue
        if source[k] == k:
            _evaluate_node(k, program, pruning, inputs, v, v[k])
        elif source[k] == NUMBER:
            v[k] = factor[k]
        else:
            _multiply(factor[k], v[source[k]], v[k])
    return v


@compile_loop()
def evaluate_unreplaced(
    program: Instructions, pruning: Pruning, inputs: FloatArray, v: FloatArray
) -> FloatArray:
    """Return the values that nodes would have if they were neither removed nor replaced, given the values of all nodes,
    (n_nodes, n_samples).
    """
    own = np.empty(v.shape)
    for k in range(program.codes.size):
        _evaluate_node(k, program, pruning, inputs, v, own[k])
    return own


@inline
def _clear_first(derivatives: FloatArray, reached: BoolArray, q: int) -> None:
    """Set derivatives to zero before something is added for the first time."""
    if not reached[q]:
        reached[q] = True
        for i in range(derivatives.size):
            derivatives[i] = 0.0


@compile_loop()
def accumulate_adjoints(
    program: Instructions, pruning: Pruning, v: FloatArray, seeds: FloatArray, which: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """Return the derivatives of the quantities with respect to the requested nodes.

    Returns:
        Derivatives, (n_nodes, n_quantities, n_samples), and a mask of those that are computed, (n_nodes, n_quantities);
        the others are uninitialised.
    """
    codes, operands = program.codes, program.operands
    outputs = program.outputs
    kept, source, factor = pruning
    n, quantities, m = codes.size, seeds.shape[1], v.shape[1]
    found = np.empty((n, quantities, m))
    reached = np.zeros((n, quantities), dtype=np.bool_)
    for o in range(outputs.size):
        k = outputs[o] >> 1
        if not which[k]:
            continue
        s = -1.0 if outputs[o] & 1 else 1.0
        for q in range(quantities):
            if np.any(seeds[o, q]):
                _clear_first(found[k, q], reached[k], q)
                for i in range(m):
                    found[k, q, i] += s * seeds[o, q, i]
    for k in range(n - 1, -1, -1):
        code = codes[k]
        if not which[k] or code <= INPUT or not kept[k, WHOLE] or source[k] == NUMBER:
            continue
        a, b = operands[k, 0] >> 1, operands[k, 1] >> 1
        s = -1.0 if operands[k, 0] & 1 else 1.0
        t = -1.0 if operands[k, 1] & 1 else 1.0
        for q in range(quantities):
            if not reached[k, q]:
                continue
            if source[k] != k:
                if which[source[k]]:
                    _clear_first(found[source[k], q], reached[source[k]], q)
                    for i in range(m):
                        found[source[k], q, i] += factor[k] * found[k, q, i]
            elif code == SUM:
                if kept[k, FIRST] and which[a]:
                    _clear_first(found[a, q], reached[a], q)
                    for i in range(m):
                        found[a, q, i] += s * found[k, q, i]
                if kept[k, SECOND] and which[b]:
                    _clear_first(found[b, q], reached[b], q)
                    for i in range(m):
                        found[b, q, i] += t * found[k, q, i]
            elif code == PRODUCT:
                if which[a]:
                    _clear_first(found[a, q], reached[a], q)
                    for i in range(m):
                        found[a, q, i] += s * t * found[k, q, i] * v[b, i]
                if which[b]:
                    _clear_first(found[b, q], reached[b], q)
                    for i in range(m):
                        found[b, q, i] += s * t * found[k, q, i] * v[a, i]
            elif code != SIGN and which[a]:
                _clear_first(found[a, q], reached[a], q)
                for i in range(m):
                    x = s * v[a, i]
                    if code == SIN:
                        slope = np.cos(x)
                    elif code == COS:
                        slope = -np.sin(x)
                    else:
                        slope = 1.0 - v[k, i] ** 2
                    found[a, q, i] += s * slope * found[k, q, i]
    return found, reached


@compile_loop()
def compute_effects(
    program: Instructions,
    pruning: Pruning,
    candidates: IntArray,
    v: FloatArray,
    kept_values: FloatArray,
    adjoints: FloatArray,
) -> FloatArray:
    """Return the value of each candidate times the derivatives of the quantities: to first order, what a present term
    contributes and what a removed term or a restored node would add, (n_candidates, n_quantities * n_samples).

    Args:
        v: Values of all nodes at the samples, (n_nodes, n_samples).
        kept_values: Values that nodes would have if they were neither removed nor replaced, from
            :func:`evaluate_unreplaced`, (n_nodes, n_samples).
        adjoints: Derivatives of the quantities by the nodes, (n_nodes, n_quantities, n_samples).
        candidates: Node and part: an operand of a sum, the node as a whole, or ITSELF for the return of a replaced
            node, (n_candidates, 2).
        program: The program.
        pruning: Pruning of the program, with the terms that are removed already.
    """
    operands = program.operands
    kept, source, factor = pruning
    _, quantities, m = adjoints.shape
    result = np.empty((candidates.shape[0], quantities * m))
    given = np.empty(m)
    for c in range(candidates.shape[0]):
        k, what = candidates[c]
        # Terms of nodes that are left out, or stand for others, give nothing.
        given[:] = 0.0
        if what == WHOLE:
            if source[k] == k:
                _multiply(1.0, kept_values[k], given)
            elif source[k] == NUMBER:
                given[:] = factor[k]
            else:
                _multiply(factor[k], v[source[k]], given)
        elif what == ITSELF:
            if kept[k, WHOLE]:
                for i in range(m):
                    given[i] = kept_values[k, i] - v[k, i]
        elif kept[k, WHOLE] and source[k] == k:
            _multiply(-1.0 if operands[k, what] & 1 else 1.0, v[operands[k, what] >> 1], given)
        for q in range(quantities):
            for i in range(m):
                result[c, q * m + i] = adjoints[k, q, i] * given[i]
    return result


@compile_loop()
def find_combinations(
    program: Instructions, pruning: Pruning, n: int
) -> tuple[IntArray, FloatArray]:
    """Return the linear combinations of the first n inputs that nodes are multiples of.

    Returns:
        Index of the node that holds the combination that each node is a multiple of, NONE or SEVERAL, (n_nodes,);
        coefficients of the nodes that are themselves such combinations, zero for other nodes, (n_nodes, n).
    """
    codes, operands = program.codes, program.operands
    numbers = program.numbers
    kept, source, factor = pruning
    found = np.full(codes.size, NONE)
    coefficients = np.zeros((codes.size, n))
    number = np.zeros(codes.size)
    for k in range(codes.size):
        code = codes[k]
        if not kept[k, WHOLE]:
            continue
        if source[k] == NUMBER:
            number[k] = factor[k]
        elif source[k] != k:
            found[k] = found[source[k]]
            _multiply(factor[k], coefficients[source[k]], coefficients[k])
        elif code == CONSTANT:
            number[k] = numbers[k]
        elif code == INPUT and numbers[k] < n:
            found[k] = k
            coefficients[k, int(numbers[k])] = 1.0
        elif code in (SUM, PRODUCT):
            a, b = operands[k, 0] >> 1, operands[k, 1] >> 1
            s = -1.0 if operands[k, 0] & 1 else 1.0
            t = -1.0 if operands[k, 1] & 1 else 1.0
            first = found[a] if code == PRODUCT or kept[k, FIRST] else NONE
            second = found[b] if code == PRODUCT or kept[k, SECOND] else NONE
            if code == PRODUCT:
                found[k] = first if second == NONE else second
                for j in range(n):
                    of_both = number[a] * coefficients[b, j] + number[b] * coefficients[a, j]
                    coefficients[k, j] = s * t * of_both
                continue
            for j in range(n):
                if first != NONE:
                    coefficients[k, j] += s * coefficients[a, j]
                if second != NONE:
                    coefficients[k, j] += t * coefficients[b, j]
            plain = (first == NONE or np.any(coefficients[a])) and (
                second == NONE or np.any(coefficients[b])
            )
            if first in (NONE, second):
                found[k] = second
            elif second == NONE:
                found[k] = first
            else:
                found[k] = k if plain else SEVERAL
            if not plain:
                coefficients[k] = 0.0
    return found, coefficients


@compile_loop()
def count_operations(program: Instructions, pruning: Pruning) -> int:
    """Return the number of operations of a pruned program."""
    codes, operands = program.codes, program.operands
    kept, source, factor = pruning
    n = codes.size
    stands_for = np.arange(n)
    for k in range(n):
        code = codes[k]
        if not kept[k, WHOLE]:
            stands_for[k] = NONE
        elif source[k] == NUMBER:
            continue
        elif source[k] != k:
            j = stands_for[source[k]]
            if j == NONE or np.abs(factor[k]) == 1.0:
                stands_for[k] = j
        elif code > INPUT:
            a, b = stands_for[operands[k, 0] >> 1], stands_for[operands[k, 1] >> 1]
            if code == SUM:
                if not kept[k, FIRST]:
                    a = NONE
                if not kept[k, SECOND]:
                    b = NONE
                if a == NONE:
                    stands_for[k] = b
                elif b == NONE:
                    stands_for[k] = a
            elif code == PRODUCT:
                if a == NONE or b == NONE:
                    stands_for[k] = NONE
                elif source[a] == NUMBER and np.abs(factor[a]) == 1.0:
                    stands_for[k] = b
                elif source[b] == NUMBER and np.abs(factor[b]) == 1.0:
                    stands_for[k] = a
            elif a == NONE and code != COS:
                stands_for[k] = NONE
    used = np.zeros(n, dtype=np.bool_)
    for value in program.outputs:
        node = stands_for[value >> 1]
        if node != NONE:
            used[node] = True
    found = 0
    for k in range(n - 1, -1, -1):
        if not used[k] or codes[k] <= INPUT or source[k] == NUMBER:
            continue
        found += 1
        if source[k] != k:
            used[stands_for[source[k]]] = True
            continue
        sides = 2 if codes[k] <= PRODUCT else 1
        for side in range(sides):
            node = stands_for[operands[k, side] >> 1]
            if node != NONE:
                used[node] = True
    return found


@compile_loop()
def count_flipped(program: Instructions, pruning: Pruning, candidates: IntArray) -> IntArray:
    """Return the number of operations after flipping each candidate: a removed term returns, a present one goes,
    (n_candidates,).
    """
    kept, source, factor = pruning
    result = np.empty(candidates.shape[0], dtype=np.int64)
    changed, sources = kept.copy(), source.copy()
    for c in range(candidates.shape[0]):
        k, what = candidates[c]
        if what == ITSELF:
            sources[k] = k
        else:
            changed[k, what] = not changed[k, what]
        result[c] = count_operations(program, Pruning(changed, sources, factor))
        if what == ITSELF:
            sources[k] = source[k]
        else:
            changed[k, what] = not changed[k, what]
    return result


@compile_loop()
def count_replaced(
    program: Instructions,
    pruning: Pruning,
    nodes: IntArray,
    standing_for: IntArray,
    times: FloatArray,
) -> IntArray:
    """Return the number of operations after one more node is replaced, (n_replacements,)."""
    kept, source, factor = pruning
    result = np.empty(nodes.size, dtype=np.int64)
    sources, factors = source.copy(), factor.copy()
    for c in range(nodes.size):
        k = nodes[c]
        sources[k], factors[k] = standing_for[c], times[c]
        result[c] = count_operations(program, Pruning(kept, sources, factors))
        sources[k], factors[k] = source[k], factor[k]
    return result
