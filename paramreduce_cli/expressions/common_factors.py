"""Common factors of the terms of a sum, taken out by loops that Numba compiles."""

from __future__ import annotations

from paramreduce_cli.expressions.rows import (
    COUNT,
    FACTOR,
    FAILED,
    HEAD,
    KIND,
    LENGTH,
    PINNED,
    PRODUCT,
    ROW,
    SUM,
    USES,
    Rows,
    add_row,
    draw_random,
    find_term,
    put,
    remove,
    take_next,
    within,
)


@within
def factor(rows: Rows) -> None:
    """Factor sums: take factors that several terms share out of the sum, the most frequent first."""
    while True:
        n = take_next(rows, FACTOR)
        if n < 0:
            break
        if rows.numbers[n, KIND] == PRODUCT and rows.numbers[n, USES] == 1:
            n = rows.links[rows.numbers[n, HEAD], ROW]
        while rows.numbers[n, KIND] == SUM and not rows.counters[FAILED]:
            common = _find_most_frequent_factor(rows, n)
            if common < 0:
                break
            _take_out(rows, n, common)


@within
def _is_own(rows: Rows, value: int) -> bool:
    """Whether a term is a product that nothing else uses."""
    n = value >> 1
    return (
        rows.numbers[n, KIND] == PRODUCT
        and rows.numbers[n, USES] == 1
        and not rows.numbers[n, PINNED]
    )


@within
def _find_most_frequent_factor(rows: Rows, n: int) -> int:
    """Return the most frequent factor of the products in a sum; negative if no two products share one."""
    result, most, own = -1, 1, 0
    for k in range(rows.numbers[n, LENGTH]):
        own += _is_own(rows, rows.terms[n, k])
    if own < 2:
        return result
    for change in (1, -1):
        for k in range(rows.numbers[n, LENGTH]):
            if not _is_own(rows, rows.terms[n, k]):
                continue
            product = rows.terms[n, k] >> 1
            for i in range(rows.numbers[product, LENGTH]):
                value = rows.terms[product, i]
                if find_term(rows, product, value, 0) < i:
                    continue
                rows.numbers[value >> 1, COUNT] += change
                count = rows.numbers[value >> 1, COUNT]
                if change > 0 and (count > most or (count == most > 1 and draw_random(rows) % 2)):
                    result, most = value, count
    return result


@within
def _take_out(rows: Rows, n: int, common: int) -> None:
    """Take a common factor out of the terms of a sum."""
    rest, inner, left, divided = rows.room[0], rows.room[1], rows.room[2], rows.room[3]
    n_inner, n_left = 0, 0
    for k in range(rows.numbers[n, LENGTH]):
        value, length, has = rows.terms[n, k], 0, False
        product = value >> 1
        if _is_own(rows, value):
            for j in range(rows.numbers[product, LENGTH]):
                if rows.terms[product, j] == common and not has:
                    has = True
                else:
                    rest[length] = rows.terms[product, j]
                    length += 1
        if has:
            quotient = rest[0] if length == 1 else add_row(rows, PRODUCT, rest[:length])
            inner[n_inner] = quotient ^ (value & 1)
            divided[n_inner] = product
            n_inner += 1
        else:
            left[n_left] = value
            n_left += 1
    rest[0], rest[1] = common, add_row(rows, SUM, inner[:n_inner])
    if n_left == 0:
        put(rows, n, PRODUCT, rest[:2])
    else:
        left[n_left] = add_row(rows, PRODUCT, rest[:2])
        put(rows, n, SUM, left[: n_left + 1])
    for k in range(n_inner):
        remove(rows, divided[k])
