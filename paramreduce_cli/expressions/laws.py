"""The laws of sums and products, applied to rows until they save no more, compiled by Numba.

Chains are taken together, terms that cancel vanish, pairs that several rows hold are computed once [Breuer1969], and a
factor common to terms of a sum is taken out. Only rows that wait are looked at.
"""

from __future__ import annotations

from paramreduce_cli.expressions.rows import (
    AFTER,
    COST,
    COUNT,
    END,
    FACTOR,
    FAILED,
    FORMER,
    HEAD,
    HIT,
    KIND,
    LENGTH,
    NONE,
    PINNED,
    PLACE,
    PRODUCT,
    ROW,
    SHARE_PRODUCT,
    SHARE_SUM,
    SUM,
    TIDY,
    USES,
    VALUE,
    Rows,
    dice,
    new,
    next_waiting,
    put,
    remove,
    wait,
    within,
)


@within
def settle(rows: Rows, products_first: bool) -> None:
    """Apply all laws until none saves an operation.

    Args:
        rows: Changed.
        products_first: Whether products share pairs before factors are taken out.
    """
    tidy(rows)
    if products_first:
        share(rows, PRODUCT)
        tidy(rows)
    factor(rows)
    tidy(rows)
    cost = rows.counters[COST] + 1
    while rows.counters[COST] < cost and not rows.counters[FAILED]:
        cost = rows.counters[COST]
        share(rows, PRODUCT)
        tidy(rows)
        share(rows, SUM)
        tidy(rows)
        factor(rows)
        tidy(rows)


@within
def tidy(rows: Rows) -> None:
    """Drop rows that nothing uses, and take those that one other row uses into it where both are sums, or products."""
    width = rows.terms.shape[1]
    while True:
        n = next_waiting(rows, TIDY)
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
    """Have others hold a row's only term in its place; products hold none that is negative."""
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
    """Put the terms of what is at a place of a row there instead."""
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


@within
def share(rows: Rows, kind: int) -> None:
    """Compute pairs once that rows of a kind have in common."""
    which = SHARE_SUM if kind == SUM else SHARE_PRODUCT
    while True:
        n = next_waiting(rows, which)
        if n < 0:
            break
        while rows.numbers[n, KIND] == kind and not rows.counters[FAILED]:
            first, second = _most_shared(rows, n)
            if first < 0:
                break
            _compute_once(rows, kind, rows.terms[n, first], rows.terms[n, second])


@within
def _most_shared(rows: Rows, n: int) -> tuple[int, int]:
    """Places of the two terms of a row that most others of its kind have too; negative if none has."""
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
        if rows.numbers[value >> 1, USES] == 1 or _place(rows, n, value, 0) < k:
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
                        b = _place(rows, n, value, k + 1)
                    there = rows.links[other, VALUE]
                    if b > a and (rows.terms[n, a] ^ there) & 1 == sign:
                        counts[a, b] += 1
                        if counts[a, b] > best or (counts[a, b] == best and dice(rows) % 2):
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
def _place(rows: Rows, n: int, value: int, start: int) -> int:
    """Where a row has a term, from a place on; END if it has not."""
    for k in range(start, rows.numbers[n, LENGTH]):
        if rows.terms[n, k] == value:
            return k
    return END


@within
def _sign_of_pair(rows: Rows, n: int, a: int, b: int) -> int:
    """The sign with which a row has a pair of terms; negative if it does not have it."""
    for sign in range(2):
        has_a, has_b = False, False
        for k in range(rows.numbers[n, LENGTH]):
            if rows.terms[n, k] == a ^ sign and not has_a:
                has_a = True
            elif rows.terms[n, k] == b ^ sign:
                has_b = True
        if has_a and has_b:
            return sign
    return -1


@within
def _compute_once(rows: Rows, kind: int, a: int, b: int) -> None:
    """Have all rows of a kind refer to one row for a pair of terms."""
    rarer = a if rows.numbers[a >> 1, USES] <= rows.numbers[b >> 1, USES] else b
    row, holders = rows.room[0], rows.room[1]
    found, shared, slot = 0, -1, rows.numbers[rarer >> 1, HEAD]
    while slot >= 0:
        n = rows.links[slot, ROW]
        sign = _sign_of_pair(rows, n, a, b) if rows.numbers[n, KIND] == kind else -1
        if sign >= 0 and rows.numbers[n, LENGTH] == 2 and shared < 0:
            shared = 2 * n + sign
        elif sign >= 0 and found < holders.size:
            holders[found] = n
            found += 1
        slot = rows.links[slot, AFTER]
    if shared < 0:
        row[0], row[1] = a, b
        shared = new(rows, kind, row[:2])
    for i in range(found):
        n = holders[i]
        sign = _sign_of_pair(rows, n, a, b)
        if rows.counters[FAILED] or n == shared >> 1 or sign < 0:
            continue
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
        row[length] = shared ^ sign
        put(rows, n, kind, row[: length + 1])


@within
def factor(rows: Rows) -> None:
    """Take factors common to terms of a sum out of it, the most frequent first."""
    while True:
        n = next_waiting(rows, FACTOR)
        if n < 0:
            break
        if rows.numbers[n, KIND] == PRODUCT and rows.numbers[n, USES] == 1:
            n = rows.links[rows.numbers[n, HEAD], ROW]
        while rows.numbers[n, KIND] == SUM and not rows.counters[FAILED]:
            common = _most_frequent_factor(rows, n)
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
def _most_frequent_factor(rows: Rows, n: int) -> int:
    """Of the products in a sum; negative if no two of them have one in common."""
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
                if _place(rows, product, value, 0) < i:
                    continue
                rows.numbers[value >> 1, COUNT] += change
                count = rows.numbers[value >> 1, COUNT]
                if change > 0 and (count > most or (count == most > 1 and dice(rows) % 2)):
                    result, most = value, count
    return result


@within
def _take_out(rows: Rows, n: int, common: int) -> None:
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
            quotient = rest[0] if length == 1 else new(rows, PRODUCT, rest[:length])
            inner[n_inner] = quotient ^ (value & 1)
            divided[n_inner] = product
            n_inner += 1
        else:
            left[n_left] = value
            n_left += 1
    rest[0], rest[1] = common, new(rows, SUM, inner[:n_inner])
    if n_left == 0:
        put(rows, n, PRODUCT, rest[:2])
    else:
        left[n_left] = new(rows, PRODUCT, rest[:2])
        put(rows, n, SUM, left[: n_left + 1])
    for k in range(n_inner):
        remove(rows, divided[k])
