"""Rewriting of sums and products at random places, by loops that Numba compiles.

What factoring has settled is a dead end of its own order: a sum that was split elsewhere, or a factor that was not
taken out, may let more be shared. So at a few places at a time a shared sum or product is written out, or a factor is
distributed over a sum; what comes of it is settled again, and kept if it takes no more operations.
"""

from __future__ import annotations

from paramreduce_cli.expressions.rows import (
    COST,
    FAILED,
    KIND,
    LENGTH,
    NONE,
    PRODUCT,
    SUM,
    TIDY,
    Rows,
    add_row,
    draw_random,
    keep,
    on_rows,
    put,
    undo,
    wait,
    within,
)
from paramreduce_cli.expressions.simplification_rules import insert, simplify_to_fixed_point

_AT_MOST = 6
"""Places at which it is rewritten at once."""
_LOOKS = 10_000
"""Looks at places, until one is found where something can be rewritten."""


@on_rows
def rewrite(rows: Rows, tries: int) -> None:
    """Rewrite rows until tries save nothing more.

    Args:
        rows: Rows of sums and products; changed in place.
        tries: Number of random rewritings that are tried after the simplification rules.
    """
    for k in range(tries + 1):
        cost = rows.counters[COST]
        if k > 0:
            for _ in range(1 + draw_random(rows) % _AT_MOST):
                _rewrite_somewhere(rows)
        simplify_to_fixed_point(rows, draw_random(rows) % 2 == 0)
        if rows.counters[FAILED] or rows.counters[COST] > cost:
            undo(rows)
        else:
            keep(rows)


@within
def _rewrite_somewhere(rows: Rows) -> None:
    """Try one rewriting at a random place."""
    for _ in range(_LOOKS):
        if rows.counters[FAILED]:
            return
        n = draw_random(rows) % rows.numbers.shape[0]
        if rows.numbers[n, KIND] == NONE:
            continue
        place = draw_random(rows) % rows.numbers[n, LENGTH]
        held = rows.numbers[rows.terms[n, place] >> 1, KIND]
        if held == rows.numbers[n, KIND]:
            insert(rows, n, place)
            return
        if held == SUM:
            _distribute(rows, n, place, draw_random(rows) % 2 == 0)
            return


@within
def _distribute(rows: Rows, n: int, place: int, joined: bool) -> None:
    """Turn a product with a sum into a sum of products.

    Args:
        rows: Rows of sums and products; changed in place.
        n: Number of the product's row.
        place: Position of the sum among the factors.
        joined: Whether the factors of products inside the sum are copied into the new products, instead of references
            to those products.
    """
    row, total = rows.room[0], rows.room[1]
    factor = rows.terms[n, place]
    terms, length = factor >> 1, rows.numbers[factor >> 1, LENGTH]
    for i in range(length):
        value = rows.terms[terms, i]
        below, k = value >> 1, 1
        row[0] = 2 * below
        if joined and rows.numbers[below, KIND] == PRODUCT:
            k = rows.numbers[below, LENGTH]
            for j in range(k):
                row[j] = rows.terms[below, j]
        for j in range(rows.numbers[n, LENGTH]):
            if j != place:
                row[k] = rows.terms[n, j]
                k += 1
        total[i] = add_row(rows, PRODUCT, row[:k]) ^ ((value ^ factor) & 1)
        wait(rows, TIDY, below)
    if not rows.counters[FAILED]:
        put(rows, n, SUM, total[:length])
