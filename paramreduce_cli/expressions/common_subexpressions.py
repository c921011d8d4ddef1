"""Common pairs of sums or products, computed once [Breuer1969], by loops that Numba compiles."""

from __future__ import annotations

from paramreduce_cli.expressions.rows import (
    AFTER,
    END,
    FAILED,
    FORMER,
    HEAD,
    HIT,
    KIND,
    LENGTH,
    PLACE,
    ROW,
    SHARE_PRODUCT,
    SHARE_SUM,
    SUM,
    USES,
    VALUE,
    Rows,
    add_row,
    draw_random,
    find_term,
    put,
    take_next,
    within,
)
from paramreduce_cli.records import IntArray


@within
def extract_common_pairs(rows: Rows, kind: int) -> None:
    """Compute each pair of terms that several rows of a kind share only once."""
    which = SHARE_SUM if kind == SUM else SHARE_PRODUCT
    while True:
        n = take_next(rows, which)
        if n < 0:
            break
        while rows.numbers[n, KIND] == kind and not rows.counters[FAILED]:
            first, second = _find_most_shared(rows, n)
            if first < 0:
                break
            _compute_once(rows, kind, rows.terms[n, first], rows.terms[n, second])


@within
def _find_most_shared(rows: Rows, n: int) -> tuple[int, int]:
    """Return the positions of the two terms of a row that most other rows of its kind share; negative if there are none."""
    counts = rows.pairs
    kind, length = rows.numbers[n, KIND], rows.numbers[n, LENGTH]
    shared = 0
    for k in range(length):
        shared += rows.numbers[rows.terms[n, k] >> 1, USES] > 1
    if shared < 2:
        return -1, -1
    for j in range(length):
        for k in range(length):
            counts[j, k] = 0
    best, first, second = 0, -1, -1
    for k in range(length):
        value = rows.terms[n, k]
        if rows.numbers[value >> 1, USES] == 1 or find_term(rows, n, value, 0) < k:
            continue
        slot = rows.numbers[value >> 1, HEAD]
        while slot != END:
            m = rows.links[slot, ROW]
            if m != n and rows.numbers[m, KIND] == kind:
                sign = (value ^ rows.links[slot, VALUE]) & 1
                other = rows.numbers[m, HIT]
                rows.links[slot, PLACE], rows.links[slot, FORMER] = k, other
                rows.numbers[m, HIT] = slot
                while other != END:
                    a, b = rows.links[other, PLACE], k
                    if a == k:  # a square, if it is one here too
                        b = find_term(rows, n, value, k + 1)
                    there = rows.links[other, VALUE]
                    if b > a and (rows.terms[n, a] ^ there) & 1 == sign:
                        counts[a, b] += 1
                        if counts[a, b] > best or (counts[a, b] == best and draw_random(rows) % 2):
                            best, first, second = counts[a, b], a, b
                    other = rows.links[other, FORMER]
            slot = rows.links[slot, AFTER]
    for k in range(length):
        slot = rows.numbers[rows.terms[n, k] >> 1, HEAD]
        while slot != END:
            rows.numbers[rows.links[slot, ROW], HIT] = END
            slot = rows.links[slot, AFTER]
    return first, second


@within
def _count_beside(rows: Rows, n: int, a: int, b: int, row: IntArray) -> tuple[int, int]:
    """Return the number of terms of a row besides a pair of terms, and the sign of the pair in the row; negative if the
    row lacks the pair.

    Args:
        rows: Rows of sums and products.
        n: Number of the row.
        a: First term of the pair.
        b: Second term of the pair.
        row: Array to which the other terms are written.
    """
    for sign in range(2):
        length, has_a, has_b = 0, False, False
        for k in range(rows.numbers[n, LENGTH]):
            value = rows.terms[n, k]
            if value == a ^ sign and not has_a:
                has_a = True
            elif value == b ^ sign and not has_b:
                has_b = True
            else:
                row[length] = value
                length += 1
        if has_a and has_b:
            return length, sign
    return 0, END


@within
def _compute_once(rows: Rows, kind: int, a: int, b: int) -> None:
    """Replace a pair of terms in all rows of a kind by a reference to one new row, as long as there is space."""
    rarer = a if rows.numbers[a >> 1, USES] <= rows.numbers[b >> 1, USES] else b
    row, holders = rows.room[0], rows.room[1]
    found, shared, slot = 0, END, rows.numbers[rarer >> 1, HEAD]
    while slot != END and found < holders.size:
        n = rows.links[slot, ROW]
        length, sign = (
            _count_beside(rows, n, a, b, row) if rows.numbers[n, KIND] == kind else (0, END)
        )
        if sign != END and length == 0 and shared == END:
            shared = 2 * n + sign
        elif sign != END:
            holders[found] = n
            found += 1
        slot = rows.links[slot, AFTER]
    if shared == END:
        row[0], row[1] = a, b
        shared = add_row(rows, kind, row[:2])
    for i in range(found):
        n = holders[i]
        length, sign = _count_beside(rows, n, a, b, row)
        if not rows.counters[FAILED] and n != shared >> 1 and sign != END:
            row[length] = shared ^ sign
            put(rows, n, kind, row[: length + 1])
