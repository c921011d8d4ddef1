"""How much is searched for one function."""

import numpy as np
import pytest

from paramreduce_cli.terms import simplify
from paramreduce_cli.terms.searching import Searcher


@pytest.mark.parametrize(
    ("rounds", "allowed", "expected"),
    [(None, 0, 8), (None, 20, 20), (None, np.inf, 64), (3, np.inf, 3), (0, np.inf, 0)],
)
def test_fewer_near_the_best_are_gone_down_from_where_functions_are_long(
    searcher, start, monkeypatch, rounds, allowed, expected
):
    turns = []
    monkeypatch.setattr(Searcher, "nearby", lambda self, what: turns.append(what.turn))
    whole = 2 * searcher.begun(start).way.fewest
    monkeypatch.setattr(simplify, "_WORK_NEARBY", allowed * whole)
    found, front = simplify.simplified(searcher, [start], rounds=rounds)
    assert turns == list(range(expected))
    assert found[0].program.n_operations == min(one.program.n_operations for one in found)
    assert front
