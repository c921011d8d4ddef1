"""Fewer operations by the laws of sums and products.

Chains of sums and of products are taken apart into sums and products of many terms, factors
common to terms of a sum are taken out of it, pairs that several sums (or products) share are
computed once [Breuer1969], and all is put together again. Results differ by rounding only.
"""

import heapq
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

from paramreduce_cli.expressions.graph import Graph

_HARDLY = 1000
"""One operation in so many: what less than that is saved by ends the factoring."""
_CLOSE = 0.002
"""Share of the operations by which a way of writing may be behind after one pass and still catch up."""


class _Terms:
    """Sums and products of many terms, by the number of their value.

    Terms are signed references as in a graph; new sums and products get numbers after those of the
    graph's nodes.
    """

    def __init__(self, graph: Graph, outputs: Sequence[int]) -> None:
        self._graph = graph
        self.reached = graph.reached(list(outputs))
        self.outputs = list(outputs)
        self.sums: dict[int, list[int]] = {}
        self.products: dict[int, list[int]] = {}
        self._next = len(graph.nodes)
        uses = Counter(value >> 1 for value in self.outputs)
        for number in self.reached:
            uses.update(value >> 1 for value in self._graph.nodes[number].operands)
        for number in self.reached:
            node = self._graph.nodes[number]
            table = self._table(node.operation)
            if table is None:
                continue
            terms = []
            for value in node.operands:
                below = value >> 1
                if below in table and uses[below] == 1:
                    terms += [term ^ (value & 1) for term in table.pop(below)]
                else:
                    terms.append(value)
            table[number] = terms

    def _table(self, operation: str) -> dict[int, list[int]] | None:
        return {"+": self.sums, "*": self.products}.get(operation)

    def new(self, table: dict[int, list[int]], terms: list[int]) -> int:
        """The value of a new sum or product."""
        number = self._next
        self._next += 1
        table[number] = terms
        return 2 * number

    def uses(self) -> Counter[int]:
        """How often every number is referred to."""
        result = Counter(value >> 1 for value in self.outputs)
        for table in (self.sums, self.products):
            for terms in table.values():
                result.update(value >> 1 for value in terms)
        for number in self.reached:
            node = self._graph.nodes[number]
            if self._table(node.operation) is None:
                result.update(value >> 1 for value in node.operands)
        return result


def factored(graph: Graph, outputs: Sequence[int], target: Graph) -> list[int]:
    """Build values again with fewer operations.

    Args:
        graph: Where the values are; one in which signs are free.
        outputs: The values.
        target: Where they are built.
    """
    terms = _Terms(graph, outputs)
    _take_out_factors(terms)
    _share_pairs(terms, terms.products)
    _share_pairs(terms, terms.sums)
    return _Assembly(graph, terms, target).built(outputs)


class Written(NamedTuple):
    """Values in a graph in which signs are free."""

    graph: Graph
    outputs: list[int]

    @property
    def n_operations(self) -> int:
        """Operations that they take."""
        return self.graph.count(self.outputs)

    def factored(self) -> "Written":
        """The same values in a graph of their own, factored once."""
        target = Graph()
        return Written(target, factored(self.graph, self.outputs, target))


def least(ways: Iterable[Written]) -> Written:
    """Factor values until it saves hardly anything.

    Args:
        ways: The same values, written in one or several ways; those that are far behind after one pass
            are dropped.

    Returns:
        What takes the fewest operations of all that were tried to the end.
    """
    once = [_once_more(way.n_operations, way) for way in ways]
    best = min(count for count, _, _ in once)
    close = [one for one in once if one[0] <= (1 + _CLOSE) * best + 1]
    return min((_to_the_end(*one) for one in close), key=lambda one: one[0])[1]


def _to_the_end(count: int, way: Written, saved: int) -> tuple[int, Written]:
    while saved > count // _HARDLY:
        count, way, saved = _once_more(count, way)
    return count, way


def _once_more(count: int, way: Written) -> tuple[int, Written, int]:
    """After one more pass, if that saves anything, and what it has saved."""
    changed = way.factored()
    after = changed.n_operations
    return (after, changed, count - after) if after < count else (count, way, 0)


def _take_out_factors(terms: _Terms) -> None:
    uses = terms.uses()
    pending = sorted(terms.sums, reverse=True)
    while pending:
        number = pending.pop()
        while (new := _take_out_one(terms, number, uses)) is not None:
            pending.append(new)


def _take_out_one(terms: _Terms, number: int, uses: Counter[int]) -> int | None:
    """Take the most frequent factor out of a sum; the number of the sum it multiplies."""
    total = terms.sums[number]
    single = [v for v in total if v >> 1 in terms.products and uses[v >> 1] == 1]
    counts = Counter(f for v in single for f in set(terms.products[v >> 1]))
    factor, count = min(counts.items(), key=lambda item: (-item[1], item[0]), default=(0, 0))
    if count < 2:
        return None
    inner, left = [], []
    for value in total:
        if value in single and factor in terms.products[value >> 1]:
            rest = list(terms.products.pop(value >> 1))
            rest.remove(factor)
            product = rest[0] if len(rest) == 1 else terms.new(terms.products, rest)
            uses[product >> 1] = max(uses[product >> 1], 1)
            inner.append(product ^ (value & 1))
        else:
            left.append(value)
    bracket = terms.new(terms.sums, inner)
    uses[factor >> 1] -= count - 1
    uses[bracket >> 1] = 1
    if not left:
        del terms.sums[number]
        terms.products[number] = [factor, bracket]
        return None
    product = terms.new(terms.products, [factor, bracket])
    uses[product >> 1] = 1
    terms.sums[number] = [*left, product]
    return bracket >> 1


def _pairs(values: Sequence[int]) -> Iterator[tuple[int, int]]:
    """All pairs of terms, up to a common sign."""
    for a, b in combinations(sorted(values), 2):
        yield (a & ~1, b ^ (a & 1))


def _share_pairs(terms: _Terms, table: dict[int, list[int]]) -> None:
    """Compute pairs once that come up in several sums, or in several products."""
    where: dict[tuple[int, int], set[int]] = defaultdict(set)
    for number, values in table.items():
        for pair in _pairs(values):
            where[pair].add(number)
    heap = [(-len(owners), pair) for pair, owners in where.items() if len(owners) > 1]
    heapq.heapify(heap)
    while heap:
        count, pair = heapq.heappop(heap)
        owners = where[pair]
        if len(owners) != -count:
            if len(owners) > 1:
                heapq.heappush(heap, (-len(owners), pair))
            continue
        whole = min((n for n in owners if len(table[n]) == len(pair)), default=None)
        shared = terms.new(table, list(pair)) if whole is None else 2 * whole
        sign = 0 if whole is None else min(table[whole]) & 1
        for number in sorted(owners):
            if number == whole:
                continue
            values = table[number]
            for old in _pairs(values):
                where[old].discard(number)
            flip = _take_pair(values, pair)
            values.append(shared ^ sign ^ flip)
            for new in _pairs(values):
                where[new].add(number)
                if len(where[new]) > 1:
                    heapq.heappush(heap, (-len(where[new]), new))


def _take_pair(values: list[int], pair: tuple[int, int]) -> int:
    """Remove a pair of terms; the sign with which it was there."""
    for flip in (0, 1):
        a, b = pair[0] ^ flip, pair[1] ^ flip
        if a in values and b in values and (a != b or values.count(a) > 1):
            values.remove(a)
            values.remove(b)
            return flip
    raise AssertionError("the pair is not there")


class _Assembly:
    """Builds terms in a graph."""

    def __init__(self, source: Graph, terms: _Terms, target: Graph) -> None:
        self._source, self._terms, self._target = source, terms, target
        self._built: dict[int, int] = {}

    def built(self, values: Sequence[int]) -> list[int]:
        """The values in the target graph, operands before what uses them."""
        pending = [value >> 1 for value in reversed(values)]
        while pending:
            number = pending[-1]
            missing = [v >> 1 for v in self._operands(number) if v >> 1 not in self._built]
            if missing and number not in self._built:
                pending += reversed(missing)
                continue
            pending.pop()
            if number not in self._built:
                self._built[number] = self._number(number)
        return self._known(values)

    def _known(self, values: Sequence[int]) -> list[int]:
        negate, built = self._target.negate, self._built
        return [negate(built[v >> 1]) if v & 1 else built[v >> 1] for v in values]

    def _operands(self, number: int) -> Sequence[int]:
        terms = self._terms.sums.get(number) or self._terms.products.get(number)
        return terms or self._source.nodes[number].operands

    def _number(self, number: int) -> int:
        graph = self._target
        for table, join in ((self._terms.sums, graph.add), (self._terms.products, graph.multiply)):
            if number in table:
                return _joined(self._known(table[number]), join)
        node = self._source.nodes[number]
        if node.operation == "constant":
            return graph.constant(node.number)
        if node.operation == "input":
            return graph.input(int(node.number))
        return graph.call(node.operation, *self._known(node.operands))


def _joined(values: list[int], join: Callable[[int, int], int]) -> int:
    """Join terms two by two, so that few wait for others."""
    while len(values) > 1:
        pairs = [join(a, b) for a, b in zip(values[::2], values[1::2], strict=False)]
        values = pairs + values[len(pairs) * 2 :]
    return values[0]
