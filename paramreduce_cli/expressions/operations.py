"""Count the operations of an expression graph.

An operation is a sum, a product, or a call of a function (sin, cos, ...) that no other
operation repeats. Nodes are hashed by what they compute, so that equal subexpressions are
one node whatever way they were built. Two rules are offered:

* ``signs_free``: sign changes are absorbed into the sum or product they meet, which is what
  compiled code does. This is the project's count.
* otherwise a sign change is an operation like any other, as where operator characters of
  generated text are counted [Ros2019].

Inputs can be declared zero (dropped parameters); what they annihilate is not counted.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import MappingProxyType
from typing import NamedTuple

import casadi as ca

_UNARY = {
    ca.OP_SIN: "sin",
    ca.OP_COS: "cos",
    ca.OP_SQRT: "sqrt",
    ca.OP_INV: "inv",
    ca.OP_ASIN: "asin",
    ca.OP_ACOS: "acos",
    ca.OP_ATAN: "atan",
    ca.OP_TAN: "tan",
}
_BINARY = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/", ca.OP_ATAN2: "atan2"}
_ODD = frozenset({"sin", "tan", "asin", "atan", "inv"})

_ZERO_CONSTANT = 0.0


class _Value(NamedTuple):
    """A signed reference to a node."""

    sign: int
    node: int


class Instruction(NamedTuple):
    """One step of a straight-line program over numbered work slots."""

    op: str
    result: int
    arguments: tuple[int, ...]
    constant: float


class Program:
    """A CasADi function as a straight-line program, ready to be counted many times.

    Args:
        function: A function of SX expressions.
    """

    def __init__(self, function: ca.Function) -> None:
        starts = []
        total = 0
        for i in range(function.n_in()):
            starts.append(total)
            total += function.nnz_in(i)
        self.input_offsets = tuple(starts)
        self.instructions = tuple(
            _read_instruction(function, k, starts) for k in range(function.n_instructions())
        )

    def count(
        self,
        zero_inputs: Collection[int] = (),
        *,
        same: Mapping[int, int] = MappingProxyType({}),
        signs_free: bool = True,
    ) -> int:
        """Count the operations that remain when some inputs are zero.

        Args:
            zero_inputs: Positions, in the concatenation of all inputs, that are zero.
            same: Positions that hold the same value as another one.
            signs_free: Whether sign changes cost nothing.

        Returns:
            Non-repeated sums, products and function calls that reach an output.
        """
        zero = frozenset(zero_inputs)
        graph = _Graph(signs_free)
        slots: dict[int, _Value] = {}
        outputs: list[_Value] = []
        for instruction in self.instructions:
            if instruction.op == "input":
                position = instruction.arguments[0]
                value = graph.input(same.get(position, position))
                slots[instruction.result] = graph.constant(0.0) if position in zero else value
            elif instruction.op == "output":
                outputs.append(slots[instruction.arguments[0]])
            elif instruction.op == "constant":
                slots[instruction.result] = graph.constant(instruction.constant)
            else:
                values = [slots[a] for a in instruction.arguments]
                slots[instruction.result] = graph.apply(instruction.op, values)
        return graph.operations(outputs)


def _read_instruction(function: ca.Function, k: int, starts: list[int]) -> Instruction:
    op = function.instruction_id(k)
    arguments = function.instruction_input(k)
    results = function.instruction_output(k)
    if op == ca.OP_CONST:
        return Instruction("constant", results[0], (), function.instruction_constant(k))
    if op == ca.OP_INPUT:
        return Instruction("input", results[0], (starts[arguments[0]] + arguments[1],), 0.0)
    if op == ca.OP_OUTPUT:
        return Instruction("output", -1, (arguments[0],), 0.0)
    if op == ca.OP_NEG:
        return Instruction("neg", results[0], tuple(arguments), 0.0)
    if op == ca.OP_SQ:
        return Instruction("*", results[0], (arguments[0], arguments[0]), 0.0)
    if op == ca.OP_TWICE:
        return Instruction("twice", results[0], tuple(arguments), 0.0)
    name = _UNARY.get(op) or _BINARY.get(op)
    if name is None:
        raise NotImplementedError(f"operation {op} of CasADi has no count")
    return Instruction(name, results[0], tuple(arguments), 0.0)


class _Graph:
    """Hash-consed nodes; a node's key says everything it computes."""

    def __init__(self, signs_free: bool) -> None:
        self._signs_free = signs_free
        self._keys: list[tuple] = []
        self._index: dict[tuple, int] = {}

    def _node(self, key: tuple) -> int:
        node = self._index.get(key)
        if node is None:
            node = len(self._keys)
            self._index[key] = node
            self._keys.append(key)
        return node

    def constant(self, value: float) -> _Value:
        return _Value(-1 if value < 0 else 1, self._node(("constant", abs(value))))

    def input(self, position: int) -> _Value:
        return _Value(1, self._node(("input", position)))

    def _constant_of(self, value: _Value) -> float | None:
        key = self._keys[value.node]
        return value.sign * key[1] if key[0] == "constant" else None

    def apply(self, op: str, values: list[_Value]) -> _Value:
        if op == "neg":
            return self._negate(values[0])
        if op == "twice":
            return self._multiply(self.constant(2.0), values[0])
        if op == "+":
            return self._add(values[0], values[1])
        if op == "-":
            return self._add(values[0], _Value(-values[1].sign, values[1].node), written=True)
        if op == "*":
            return self._multiply(values[0], values[1])
        if self._signs_free and op in _ODD:
            return _Value(values[0].sign, self._node((op, _Value(1, values[0].node))))
        if op == "cos":
            return _Value(1, self._node((op, _Value(1, values[0].node))))
        return _Value(1, self._node((op, *values)))

    def _negate(self, value: _Value) -> _Value:
        if self._signs_free or self._keys[value.node][0] == "constant":
            return _Value(-value.sign, value.node)
        key = self._keys[value.node]
        if key[0] == "neg":
            return _Value(1, key[1])
        return _Value(1, self._node(("neg", value.node)))

    def _add(self, a: _Value, b: _Value, *, written: bool = False) -> _Value:
        ca_, cb_ = self._constant_of(a), self._constant_of(b)
        if ca_ is not None and cb_ is not None:
            return self.constant(ca_ + cb_)
        if ca_ == _ZERO_CONSTANT:
            return b if not written or b.sign > 0 else self._negate(_Value(-b.sign, b.node))
        if cb_ == _ZERO_CONSTANT:
            return a
        if a.node == b.node:
            if a.sign != b.sign:
                return self.constant(0.0)
            return self._multiply(self.constant(2.0), a)
        if b.node < a.node:
            a, b = b, a
        if self._signs_free:
            return _Value(a.sign, self._node(("+", a.node, a.sign * b.sign, b.node)))
        return _Value(1, self._node(("+", a, b)))

    def _multiply(self, a: _Value, b: _Value) -> _Value:
        ca_, cb_ = self._constant_of(a), self._constant_of(b)
        if ca_ is not None and cb_ is not None:
            return self.constant(ca_ * cb_)
        if ca_ is None and cb_ is not None:
            a, b, ca_ = b, a, cb_
        if ca_ == _ZERO_CONSTANT:
            return self.constant(0.0)
        if ca_ is not None and abs(ca_) == 1.0:
            return b if ca_ > 0 else self._negate(b)
        low, high = sorted((a.node, b.node))
        return _Value(a.sign * b.sign, self._node(("*", low, high)))

    def operations(self, outputs: list[_Value]) -> int:
        seen = {value.node for value in outputs}
        pending = list(seen)
        count = 0
        while pending:
            key = self._keys[pending.pop()]
            if key[0] in ("constant", "input"):
                continue
            count += 1
            for node in _operands(key):
                if node not in seen:
                    seen.add(node)
                    pending.append(node)
        return count


def _operands(key: tuple) -> list[int]:
    if key[0] == "+" and len(key) == 4:
        return [key[1], key[3]]
    return [part.node if isinstance(part, _Value) else part for part in key[1:]]
