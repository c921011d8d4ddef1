"""How much is searched for one function."""

from dataclasses import replace

import pytest

from paramreduce_cli.terms import leanest_program
from paramreduce_cli.terms.parallel_descents import Searcher


def test_going_down_once_more_takes_nothing_away_from_what_goes_on_with_more_samples(
    searcher, start, monkeypatch
):
    found = leanest_program.simplify(searcher, [start], max_rounds=8).ends
    monkeypatch.setattr(Searcher, "repeat_descent", lambda self, what: None)
    without = leanest_program.simplify(searcher, [start], max_rounds=8).ends
    assert found[0].program.n_operations <= without[0].program.n_operations


@pytest.mark.parametrize("kind", ["descend_nearby", "repeat_descent"])
@pytest.mark.parametrize(
    ("rounds", "gains", "expected"),
    [
        (24, {}, 24), (24, {3: 1}, 32), (24, {3: 1, 20: 1}, 48), (24, {30: 1}, 24),
        (12, {}, 12), (3, {}, 3), (0, {}, 0),
    ],
)  # fmt: skip
def test_more_descents_are_made_until_so_many_in_a_row_bring_nothing(
    searcher, start, monkeypatch, kind, rounds, gains, expected
):
    turns, told = gone_down(searcher, start, monkeypatch, kind, rounds, gains)
    assert turns == list(range(expected))
    assert max(told) <= 1.0


@pytest.mark.parametrize(("gain", "expected"), [(2, 8), (3, 16)])
def test_less_than_one_operation_in_so_many_is_nothing(
    searcher, start, monkeypatch, gain, expected
):
    monkeypatch.setattr(leanest_program, "_HARDLY", searcher.descend(start).fewest / 3)
    turns, _ = gone_down(searcher, start, monkeypatch, "repeat_descent", 8, {3: gain})
    assert turns == list(range(expected))


def gone_down(searcher, start, monkeypatch, kind, rounds, gains):
    """Numbers of the descents of one kind, some of which save so many operations, and what progress was told."""
    turns, told = [], []
    way = searcher.descend(start)
    fewest = [way.fewest]

    def work(self, what):
        turns.append(what.seed_index)
        fewest[0] -= gains.get(what.seed_index, 0)
        return replace(way, fewest=fewest[0] if what.seed_index in gains else way.fewest + 1)

    for name in ("descend_nearby", "repeat_descent"):
        monkeypatch.setattr(Searcher, name, work if name == kind else lambda self, what: None)
    found = leanest_program.simplify(
        searcher, [start], max_rounds=rounds, progress=lambda share, detail: told.append(share)
    )
    counts = [one.program.n_operations for one in found.ends]
    assert counts == sorted(counts)
    assert found.front
    return turns, told


def test_when_time_is_up_what_was_found_is_gone_on_with_and_nothing_else_begun(
    searcher, start, monkeypatch
):
    begun = []
    for name in ("descend", "descend_nearby", "repeat_descent", "descend_closely"):
        work = getattr(Searcher, name)
        monkeypatch.setattr(
            Searcher,
            name,
            lambda self, what, n=name, work=work: begun.append(n) or work(self, what),
        )
    whole = leanest_program.simplify(searcher, [start], max_rounds=8)
    assert not whole.cut_short
    assert {"descend_nearby", "repeat_descent"} < set(begun)
    begun.clear()
    found = leanest_program.simplify(searcher, [start], max_rounds=8, seconds=1e-9)
    assert begun == ["descend", "descend_closely"]
    assert found.cut_short
    least = min(one.program.n_operations for one in found.ends)
    assert least < searcher.start_descent(start).history.fewest
    assert least >= whole.ends[0].program.n_operations
