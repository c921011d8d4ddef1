"""Sums and products of many terms in arrays that can be changed and restored, for loops that Numba compiles.

A number stands for a value. That of a sum or a product has a row of terms, which are signed references as in a
graph; those of products are positive, as signs are part of what refers to the product. Of all others it is only
known who holds them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple, cast

import numpy as np

from paramreduce_cli.expressions.loops import compile_loop
from paramreduce_cli.records import IntArray

# Codes that are handed on are integers of NumPy: for plain ones Numba compiles each function anew.
NONE, SUM, PRODUCT = cast("tuple[int, int, int]", tuple(np.arange(3)))
"""What a number is: anything that has no row, or what its row is joined to."""
KIND, LENGTH, NUMBER, USES, HEAD, PINNED, IS_SAVED, HIT, COUNT, WAITS = range(10)
"""What is known of a number: what it is, how many terms it has, itself, how many rows hold it and the first slot that
does, whether anything else refers to it, whether its row is saved; room for the last slot of its row that another has, END, and for a count,
0; from the last on, on which lists it waits."""
AFTER, BEFORE, ROW, VALUE, PLACE, FORMER = range(6)
"""Of a slot: its neighbours in the chain, the row that it is in, the term that is in it; room for where another row has
this term, and for the slot before in its own row of which there is such a place."""
TIDY, SHARE_SUM, SHARE_PRODUCT, FACTOR = cast("tuple[int, int, int, int]", tuple(np.arange(4)))
"""Lists of numbers that are to be looked at, by what for."""
COST, SAVED, LAST, DICE, FAILED, WAITING = range(6)
"""Counters: operations, rows saved, the last number given, the state of the dice, whether there was no room; from the
last on, how many wait on each list."""
END = -1

on_rows = compile_loop(makes_arrays=False)
"""On rows for functions of rows that are called from Python, too."""
within = compile_loop(within=True, makes_arrays=False)
"""Within for all others."""


class Rows(NamedTuple):
    """A record of the rows of sums and products of some values, in few arrays, because each array adds compilation time."""

    numbers: IntArray
    """Counters of every number, (size, WAITS + lists)."""
    terms: IntArray
    """(size, width)"""
    links: IntArray
    """Chains of the slots that hold a number, a slot being width times the row plus the place in it, (size * width, 6)"""
    waiting: IntArray
    """Lists of numbers, (lists, size)"""
    saved: IntArray
    """Rows that have changed since :func:`keep`, with their former contents, (size, 3)."""
    saved_terms: IntArray
    """(size, width)"""
    counters: IntArray
    """(WAITING + lists,)"""
    room: IntArray
    """Buffer for rows under construction, (4, 2 * size + 2 * width)."""
    pairs: IntArray
    """Counts of pairs of terms, (width, width)."""


def make_rows(
    sums: Mapping[int, Sequence[int]],
    products: Mapping[int, Sequence[int]],
    pinned: Iterable[int],
    numbers: int,
    others: int,
) -> Rows:
    """Return rows in arrays, all of them on the worklist.

    Args:
        sums: Terms of each sum, by number.
        products: Terms of each product, by number; none is negative.
        pinned: Numbers, with or without a row, that outputs or functions refer to.
        numbers: Number of slots in use.
        others: Operations that have no row.
    """
    tables = ((SUM, sums), (PRODUCT, products))
    longest = max((len(row) for _, table in tables for row in table.values()), default=1)
    width, size = 2 * longest + 8, 3 * numbers // 2 + 64
    lists = FACTOR + 1

    def zeros(*shape: int) -> IntArray:
        return np.zeros(shape, dtype=np.int64)

    def small_zeros(*shape: int) -> IntArray:
        # The largest arrays hold numbers of slots, which fit into 32 bits.
        return np.zeros(shape, dtype=np.int32)

    rows = Rows(
        numbers=zeros(size, WAITS + lists),
        terms=small_zeros(size, width),
        links=small_zeros(size * width, 6),
        waiting=zeros(lists, size),
        saved=zeros(size, 3),
        saved_terms=small_zeros(size, width),
        counters=zeros(WAITING + lists),
        room=zeros(4, 2 * (size + width)),
        pairs=zeros(width, width),
    )
    rows.numbers[:, [HEAD, HIT]] = END
    rows.numbers[list(pinned), PINNED] = True
    rows.counters[LAST] = numbers
    rows.counters[COST] = others
    for kind, table in tables:
        for number, row in table.items():
            put(rows, number, kind, np.array(row, dtype=np.int64))
    keep(rows)
    return rows


def list_terms(rows: Rows, kind: int) -> dict[int, list[int]]:
    """Return the terms of all rows of a kind, by the number of the row."""
    numbers = np.flatnonzero(rows.numbers[:, KIND] == kind).tolist()
    return {n: rows.terms[n, : rows.numbers[n, LENGTH]].tolist() for n in numbers}


@within
def draw_random(rows: Rows) -> int:
    """Return a random number, the same on every machine."""
    state = (rows.counters[DICE] * 1103515245 + 12345) & 0x7FFFFFFFFFFF
    rows.counters[DICE] = state
    return state >> 16


@within
def find_term(rows: Rows, n: int, value: int, start: int) -> int:
    """Return the position of a term in a row, from position ``start`` on; END if there is none."""
    for k in range(start, rows.numbers[n, LENGTH]):
        if rows.terms[n, k] == value:
            return k
    return END


@within
def wait(rows: Rows, which: int, number: int) -> None:
    """Put a number on a list, once."""
    if not rows.numbers[number, WAITS + which]:
        rows.numbers[number, WAITS + which] = True
        rows.waiting[which, rows.counters[WAITING + which]] = number
        rows.counters[WAITING + which] += 1


@within
def take_next(rows: Rows, which: int) -> int:
    """Return and remove the last row number of a worklist; negative if the list is empty or an earlier step failed."""
    if rows.counters[WAITING + which] == 0 or rows.counters[FAILED]:
        return END
    rows.counters[WAITING + which] -= 1
    number = rows.waiting[which, rows.counters[WAITING + which]]
    rows.numbers[number, WAITS + which] = False
    return number


@within
def _replace(rows: Rows, number: int, kind: int, row: IntArray) -> None:
    """Replace a row, and update the links of its terms."""
    width, length = rows.terms.shape[1], row.size
    for k in range(rows.numbers[number, LENGTH]):
        held, slot = rows.terms[number, k] >> 1, number * width + k
        after, before = rows.links[slot, AFTER], rows.links[slot, BEFORE]
        if before == END:
            rows.numbers[held, HEAD] = after
        else:
            rows.links[before, AFTER] = after
        if after != END:
            rows.links[after, BEFORE] = before
        rows.numbers[held, USES] -= 1
    if rows.numbers[number, KIND] != NONE:
        rows.counters[COST] -= rows.numbers[number, LENGTH] - 1
    rows.numbers[number, KIND] = kind
    rows.numbers[number, LENGTH] = length
    for k in range(length):
        held, slot = row[k] >> 1, number * width + k
        rows.terms[number, k] = row[k]
        rows.links[slot, ROW] = number
        rows.links[slot, VALUE] = row[k]
        rows.links[slot, AFTER] = rows.numbers[held, HEAD]
        rows.links[slot, BEFORE] = END
        if rows.numbers[held, HEAD] != END:
            rows.links[rows.numbers[held, HEAD], BEFORE] = slot
        rows.numbers[held, HEAD] = slot
        rows.numbers[held, USES] += 1
    if kind != NONE:
        rows.counters[COST] += length - 1


@within
def _cancel(row: IntArray) -> int:
    """Remove terms with their opposites, and return how many terms are left."""
    left = 0
    for k in range(row.size):
        opposite = -1
        for j in range(left):
            if row[j] == row[k] ^ 1:
                opposite = j
        if opposite < 0:
            row[left] = row[k]
            left += 1
        else:
            left -= 1
            row[opposite] = row[left]
    return left


@on_rows
def put(rows: Rows, number: int, kind: int, row: IntArray) -> None:
    """Replace the terms of a row.

    If they are too many, the row stays and the counter FAILED is set. The former row is saved for :func:`undo`, and the
    row enters the worklists.

    Args:
        rows: Rows of sums and products; changed in place.
        number: Number of the row.
        kind: Operation of the new row: sum or product; NONE to take the row away, which then enters no worklist.
        row: New terms; changed in place. Opposite terms of a sum cancel, and an empty sum becomes zero.
    """
    if kind == SUM:
        length = _cancel(row)
        if length == 0:
            row[0], length = 0, 1
        row = row[:length]
    if row.size > rows.terms.shape[1]:
        rows.counters[FAILED] = 1
        return
    if not rows.numbers[number, IS_SAVED]:
        k = rows.counters[SAVED]
        rows.numbers[number, IS_SAVED] = True
        rows.saved[k, NUMBER] = number
        rows.saved[k, KIND] = rows.numbers[number, KIND]
        rows.saved[k, LENGTH] = rows.numbers[number, LENGTH]
        for i in range(rows.numbers[number, LENGTH]):
            rows.saved_terms[k, i] = rows.terms[number, i]
        rows.counters[SAVED] += 1
    for k in range(rows.numbers[number, LENGTH]):
        wait(rows, TIDY, rows.terms[number, k] >> 1)
    _replace(rows, number, kind, row)
    if kind != NONE:
        wait(rows, TIDY, number)
        wait(rows, SHARE_SUM if kind == SUM else SHARE_PRODUCT, number)
        wait(rows, FACTOR, number)


@within
def remove(rows: Rows, number: int) -> None:
    """Take a number's row away."""
    put(rows, number, NONE, rows.terms[number, :0])


@within
def add_row(rows: Rows, kind: int, row: IntArray) -> int:
    """Add a row, and return the reference to it; the counter FAILED is set if no number is free."""
    number = rows.counters[LAST]
    for _ in range(rows.numbers.shape[0]):
        number = max(1, (number + 1) % rows.numbers.shape[0])  # zero is zero
        known = rows.numbers[number]
        if known[KIND] == NONE and known[USES] == 0 and not known[PINNED]:
            rows.counters[LAST] = number
            put(rows, number, kind, row)
            return 2 * number
    rows.counters[FAILED] = 1
    return 0


@on_rows
def keep(rows: Rows) -> None:
    """Save the current rows as the state that :func:`undo` restores."""
    for k in range(rows.counters[SAVED]):
        rows.numbers[rows.saved[k, NUMBER], IS_SAVED] = False
    rows.counters[SAVED] = 0


@within
def undo(rows: Rows) -> None:
    """Restore the rows that :func:`keep` saved, and clear the worklists."""
    for k in range(rows.counters[SAVED]):
        row = rows.saved_terms[k, : rows.saved[k, LENGTH]]
        _replace(rows, rows.saved[k, NUMBER], rows.saved[k, KIND], row)
    keep(rows)
    for which in range(rows.waiting.shape[0]):
        for k in range(rows.counters[WAITING + which]):
            rows.numbers[rows.waiting[which, k], WAITS + which] = False
        rows.counters[WAITING + which] = 0
    rows.counters[FAILED] = 0
