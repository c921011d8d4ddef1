"""How much is searched for one function."""

from dataclasses import replace

import numpy as np
import pytest

from paramreduce_cli.terms import simplify
from paramreduce_cli.terms.searching import Searcher


@pytest.mark.parametrize(
    ("rounds", "allowed", "expected"),
    [(None, 0, 8), (None, 20, 20), (None, np.inf, 40), (3, np.inf, 3), (0, np.inf, 0)],
)
def test_fewer_near_the_best_are_gone_down_from_where_functions_are_long(
    searcher, start, monkeypatch, rounds, allowed, expected
):
    turns = []
    monkeypatch.setattr(Searcher, "nearby", lambda self, what: turns.append(what.turn))
    monkeypatch.setattr(Searcher, "again", lambda self, what: None)
    whole = 2 * searcher.begun(start).way.fewest
    monkeypatch.setattr(simplify, "_WORK_NEARBY", allowed * whole)
    found, front, cut_short = simplify.simplified(searcher, [start], rounds=rounds)
    assert not cut_short
    assert turns == list(range(expected))
    assert found[0].program.n_operations == min(one.program.n_operations for one in found)
    assert front


def test_going_down_once_more_takes_nothing_away_from_what_goes_on_with_more_samples(
    searcher, start, monkeypatch
):
    found = simplify.simplified(searcher, [start], rounds=8).ends
    monkeypatch.setattr(Searcher, "again", lambda self, what: None)
    without = simplify.simplified(searcher, [start], rounds=8).ends
    assert found[0].program.n_operations <= without[0].program.n_operations


@pytest.mark.parametrize(
    ("rounds", "gains", "expected"),
    [(24, (), 24), (24, (3,), 32), (24, (3, 20), 48), (24, (30,), 24), (12, (), 12), (3, (), 3)],
)
def test_descents_once_more_go_on_until_so_many_in_a_row_bring_nothing(
    searcher, start, monkeypatch, rounds, gains, expected
):
    turns, told = [], []

    def again(self, what):
        turns.append(what.turn)
        fewest = what.way.fewest - 1 if what.turn in gains else what.way.fewest + 1
        return replace(what.way, fewest=fewest)

    monkeypatch.setattr(Searcher, "nearby", lambda self, what: None)
    monkeypatch.setattr(Searcher, "again", again)
    simplify.simplified(
        searcher, [start], rounds=rounds, progress=lambda share, remark: told.append(share)
    )
    assert turns == list(range(expected))
    assert max(told) <= 1.0


def test_when_time_is_up_what_was_found_is_gone_on_with_and_nothing_else_begun(
    searcher, start, monkeypatch
):
    begun = []
    for name in ("down", "nearby", "again", "closer"):
        work = getattr(Searcher, name)
        monkeypatch.setattr(
            Searcher,
            name,
            lambda self, what, n=name, work=work: begun.append(n) or work(self, what),
        )
    whole = simplify.simplified(searcher, [start], rounds=8)
    assert not whole.cut_short
    assert {"nearby", "again"} < set(begun)
    begun.clear()
    found = simplify.simplified(searcher, [start], rounds=8, seconds=1e-9)
    assert begun == ["down", "closer"]
    assert found.cut_short
    least = min(one.program.n_operations for one in found.ends)
    assert least < searcher.begun(start).way.fewest
    assert least >= whole.ends[0].program.n_operations
