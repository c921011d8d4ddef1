"""Simplification rules of sums and products, applied to rows by loops that Numba compiles.

Chains are taken together, terms that cancel vanish, pairs that several rows hold are computed once [Breuer1969], and a
factor common to terms of a sum is taken out. Only rows that wait are looked at.
"""

from __future__ import annotations

from paramreduce_cli.expressions.common_factors import factor
from paramreduce_cli.expressions.common_subexpressions import extract_common_pairs
from paramreduce_cli.expressions.rows import (
    AFTER,
    COST,
    FAILED,
    HEAD,
    KIND,
    LENGTH,
    NONE,
    PINNED,
    PRODUCT,
    ROW,
    SUM,
    TIDY,
    USES,
    Rows,
    put,
    remove,
    take_next,
    wait,
    within,
)


@within
def simplify_to_fixed_point(rows: Rows, products_first: bool) -> None:
    """Apply all simplification rules until none saves an operation.

    Args:
        rows: Rows of sums and products; changed in place.
        products_first: Whether products share pairs before factors are taken out.
    """
    tidy(rows)
    if products_first:
        extract_common_pairs(rows, PRODUCT)
        tidy(rows)
    factor(rows)
    tidy(rows)
    cost = rows.counters[COST] + 1
    while rows.counters[COST] < cost and not rows.counters[FAILED]:
        cost = rows.counters[COST]
        extract_common_pairs(rows, PRODUCT)
        tidy(rows)
        extract_common_pairs(rows, SUM)
        tidy(rows)
        factor(rows)
        tidy(rows)


@within
def tidy(rows: Rows) -> None:
    """Remove unused rows, and merge a row that only one row of the same kind uses into that row."""
    width = rows.terms.shape[1]
    while True:
        n = take_next(rows, TIDY)
        if n < 0:
            break
        kind = rows.numbers[n, KIND]
        if kind == NONE:
            continue
        if not rows.numbers[n, PINNED]:
            if rows.numbers[n, USES] == 0:
                remove(rows, n)
                continue
            if rows.numbers[n, LENGTH] == 1:
                _resolve(rows, n)
                continue
            slot = rows.numbers[n, HEAD]
            holder = rows.links[slot, ROW]
            if rows.numbers[n, USES] == 1 and rows.numbers[holder, KIND] == kind:
                insert(rows, holder, slot - holder * width)
                continue
        for k in range(rows.numbers[n, LENGTH]):
            held = rows.terms[n, k] >> 1
            if rows.numbers[held, KIND] == kind and rows.numbers[held, USES] == 1:
                wait(rows, TIDY, held)


@within
def _resolve(rows: Rows, n: int) -> None:
    """Replace a row that has only one term by this term wherever the row is used.

    Products keep the row if the term is negative, because terms of products are never negative.
    """
    width = rows.terms.shape[1]
    negative = rows.terms[n, 0] & 1
    slot = rows.numbers[n, HEAD]
    while slot >= 0 and not rows.counters[FAILED]:
        holder = rows.links[slot, ROW]
        if negative and rows.numbers[holder, KIND] == PRODUCT:
            slot = rows.links[slot, AFTER]
        else:
            insert(rows, holder, slot - holder * width)
            slot = rows.numbers[n, HEAD]


@within
def insert(rows: Rows, holder: int, place: int) -> None:
    """Replace a term of a row by the terms of the row that it refers to."""
    kind, value = rows.numbers[holder, KIND], rows.terms[holder, place]
    held = value >> 1
    row, length = rows.room[0], 0
    for k in range(rows.numbers[holder, LENGTH]):
        if k != place:
            row[length] = rows.terms[holder, k]
            length += 1
    for k in range(rows.numbers[held, LENGTH]):
        row[length] = rows.terms[held, k] ^ (value & 1)
        length += 1
    put(rows, holder, kind, row[:length])
