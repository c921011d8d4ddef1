"""Fewer operations by the laws of sums and products.

Chains of sums and of products are taken apart into sums and products of many terms; what these have in common is
computed once, as far as the laws and rewriting find it, and all is put together again. Results differ by rounding only.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.expressions.rewriting import rewrite
from paramreduce_cli.expressions.rows import COST, DICE, PRODUCT, SUM, Rows, rows_of, terms_of

_CLOSE = {0.0: 0.01, 1.0: 0.003}
"""After so many rewritings per operation, the share of them by which a way of writing may be behind and go on."""
_TRIES = 2
"""Rewritings per operation that are tried at a time; when they save hardly anything, it ends."""
_HARDLY = 1000
"""One operation in so many: what less than that is saved by ends it."""
_LONG = 1000
"""Operations, from which on fewer are tried, as each takes longer and there are more places to save something."""


class Written(NamedTuple):
    """Values in a graph in which signs are free."""

    graph: Graph
    outputs: list[int]

    @property
    def n_operations(self) -> int:
        """Operations that they take."""
        return self.graph.count(self.outputs)

    def settled(self) -> "Written":
        """The same values after the laws have been applied."""
        rows = self.taken_apart()
        rewrite(rows, 0)
        return self.put_together(rows)

    def taken_apart(self) -> Rows:
        """Sums and products of many terms, by the numbers of the nodes."""
        nodes, reached = self.graph.nodes, self.graph.reached(self.outputs)
        uses = Counter(value >> 1 for value in self.outputs)
        for number in reached:
            uses.update(value >> 1 for value in nodes[number].operands)
        tables: dict[str, dict[int, list[int]]] = {"+": {}, "*": {}}
        pinned = {value >> 1 for value in self.outputs}
        calls = 0
        for number in reached:
            operation, operands, _ = nodes[number]
            table = tables.get(operation)
            if table is None:
                pinned.update(value >> 1 for value in operands)
                calls += len(operands) > 0
                continue
            terms = table[number] = []
            for value in operands:
                below = value >> 1
                if below in table and uses[below] == 1:
                    terms += [term ^ (value & 1) for term in table.pop(below)]
                else:
                    terms.append(value)
        return rows_of(tables["+"], tables["*"], pinned, len(nodes), calls)

    def put_together(self, rows: Rows) -> "Written":
        """The same values in a graph of their own.

        Args:
            rows: What became of :meth:`taken_apart`.
        """
        target = Graph()
        sums, products = terms_of(rows, SUM), terms_of(rows, PRODUCT)
        return Written(target, _Assembly(self.graph, sums, products, target).built(self.outputs))


def least(ways: Iterable[Written], dice: int = 0) -> Written:
    """Write values with fewer operations.

    Args:
        ways: The same values, written in one or several ways; those that are far behind before they are
            rewritten are dropped.
        dice: Where they begin; others may come to another end.

    Returns:
        What takes the fewest operations.
    """
    apart = [(way, way.taken_apart()) for way in ways]
    for _, rows in apart:
        rows.counters[DICE] = dice
    for tries, share in _CLOSE.items():
        for _, rows in apart:
            rewrite(rows, int(tries * _places(rows)))
        close = (1 + share) * min(rows.counters[COST] for _, rows in apart)
        apart = [(way, rows) for way, rows in apart if rows.counters[COST] <= close]
    for _, rows in apart:
        _rewrite_to_the_end(rows)
    return min((way.put_together(rows) for way, rows in apart), key=lambda way: way.n_operations)


def _rewrite_to_the_end(rows: Rows) -> None:
    count = saved = int(rows.counters[COST])
    while saved > count // _HARDLY:
        rewrite(rows, _TRIES * _places(rows))
        saved = count - int(rows.counters[COST])
        count -= saved


def _places(rows: Rows) -> int:
    count = int(rows.counters[COST])
    return min(count, _LONG**2 // max(count, 1))


class _Assembly:
    """Builds terms in a graph."""

    def __init__(
        self,
        source: Graph,
        sums: Mapping[int, Sequence[int]],
        products: Mapping[int, Sequence[int]],
        target: Graph,
    ) -> None:
        self._source, self._sums, self._products, self._target = source, sums, products, target
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
        terms = self._sums.get(number) or self._products.get(number)
        return terms or self._source.nodes[number].operands

    def _number(self, number: int) -> int:
        graph = self._target
        if number in self._sums:
            return _joined(self._known(self._sums[number]), graph.add)
        if number in self._products:
            factors = self._known(self._products[number])
            factors.sort(key=lambda value: graph.number(value) is None)  # so that numbers meet
            return _joined(factors, graph.multiply)
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
