"""Factoring: fewer operations by the simplification rules of sums and products.

Chains of sums and of products are taken apart into sums and products of many terms; what these have in common is
computed once, as far as the laws and rewriting find it, and all is put together again. Results differ by rounding only.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.expressions.rewriting import rewrite
from paramreduce_cli.expressions.rows import COST, DICE, PRODUCT, SUM, Rows, list_terms, make_rows

_CLOSE = {0.0: 0.01, 1.0: 0.003}
"""After so many rewritings per operation, the share of them by which a way of writing may be behind and go on."""
_TRIES = 2
"""Rewritings per operation that are tried at a time; when they save hardly anything, it ends."""
_HARDLY = 1000
"""One operation in so many: what less than that is saved by ends it."""
_LONG = 1000
"""Operations, from which on fewer are tried, as each takes longer and there are more places to save something."""


class Values(NamedTuple):
    """The values in a graph in which signs are free."""

    graph: Graph
    outputs: list[int]

    @property
    def n_operations(self) -> int:
        """Operations that they take."""
        return self.graph.count_operations(self.outputs)

    def simplify(self) -> "Values":
        """Return the same values after the simplification rules have been applied until none saves an operation."""
        rows = self.to_rows()
        rewrite(rows, 0)
        return self.from_rows(rows)

    def to_rows(self) -> Rows:
        """Return sums and products as rows of terms, which rewriting works on; a row has the index of its node."""
        nodes, reached = self.graph.nodes, self.graph.find_reached(self.outputs)
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
        return make_rows(tables["+"], tables["*"], pinned, len(nodes), calls)

    def from_rows(self, rows: Rows) -> "Values":
        """Return the values of rows in a new graph.

        Args:
            rows: Rows from :meth:`to_rows`, possibly rewritten.
        """
        target = Graph()
        sums, products = list_terms(rows, SUM), list_terms(rows, PRODUCT)
        return Values(target, _Assembly(self.graph, sums, products, target).build(self.outputs))


def minimise_operations(candidates: Iterable[Values], seed: int = 0) -> Values:
    """Return the leanest values that rewriting finds.

    Args:
        candidates: The same values, written in one or several ways; only those with nearly the fewest operations are
            rewritten.
        seed: Seed of the random changes.

    Returns:
        Values with the fewest operations found.
    """
    apart = [(candidate, candidate.to_rows()) for candidate in candidates]
    for _, rows in apart:
        rows.counters[DICE] = seed
    for tries, fraction in _CLOSE.items():
        for _, rows in apart:
            rewrite(rows, int(tries * _count_places(rows)))
        close = (1 + fraction) * min(rows.counters[COST] for _, rows in apart)
        apart = [(candidate, rows) for candidate, rows in apart if rows.counters[COST] <= close]
    for _, rows in apart:
        _rewrite_fully(rows)
    return min(
        (candidate.from_rows(rows) for candidate, rows in apart),
        key=lambda values: values.n_operations,
    )


def _rewrite_fully(rows: Rows) -> None:
    """Rewrite rows until a round saves hardly anything."""
    count = saved = int(rows.counters[COST])
    while saved > count // _HARDLY:
        rewrite(rows, _TRIES * _count_places(rows))
        saved = count - int(rows.counters[COST])
        count -= saved


def _count_places(rows: Rows) -> int:
    """Return the number of columns that common factors are searched in, fewer for long programs."""
    count = int(rows.counters[COST])
    return min(count, _LONG**2 // max(count, 1))


class _Assembly:
    """A builder of rows' terms in a graph."""

    def __init__(
        self,
        source: Graph,
        sums: Mapping[int, Sequence[int]],
        products: Mapping[int, Sequence[int]],
        target: Graph,
    ) -> None:
        self._source, self._sums, self._products, self._target = source, sums, products, target
        self._built: dict[int, int] = {}

    def build(self, values: Sequence[int]) -> list[int]:
        """Return the values in the target graph; operands are built before their users."""
        pending = [value >> 1 for value in reversed(values)]
        while pending:
            number = pending[-1]
            missing = [v >> 1 for v in self._list_operands(number) if v >> 1 not in self._built]
            if missing and number not in self._built:
                pending += reversed(missing)
                continue
            pending.pop()
            if number not in self._built:
                self._built[number] = self._build_number(number)
        return self._get_built(values)

    def _get_built(self, values: Sequence[int]) -> list[int]:
        """Return the signed references of rebuilt operands."""
        negate, built = self._target.negate, self._built
        return [negate(built[v >> 1]) if v & 1 else built[v >> 1] for v in values]

    def _list_operands(self, number: int) -> Sequence[int]:
        """Return the operands of a node after rewriting."""
        terms = self._sums.get(number) or self._products.get(number)
        return terms or self._source.nodes[number].operands

    def _build_number(self, number: int) -> int:
        """Build the node of a number, and return its reference."""
        graph = self._target
        if number in self._sums:
            return _join_pairwise(self._get_built(self._sums[number]), graph.add)
        if number in self._products:
            factors = self._get_built(self._products[number])
            factors.sort(key=lambda value: graph.number(value) is None)  # so that numbers meet
            return _join_pairwise(factors, graph.multiply)
        node = self._source.nodes[number]
        if node.operation == "constant":
            return graph.constant(node.number)
        if node.operation == "input":
            return graph.input(int(node.number))
        return graph.call(node.operation, *self._get_built(node.operands))


def _join_pairwise(values: list[int], join: Callable[[int, int], int]) -> int:
    """Add or multiply terms in a balanced tree, which shortens the chain of dependencies."""
    while len(values) > 1:
        pairs = [join(a, b) for a, b in zip(values[::2], values[1::2], strict=False)]
        values = pairs + values[len(pairs) * 2 :]
    return values[0]
