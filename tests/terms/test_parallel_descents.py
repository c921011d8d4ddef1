"""Descents in this process and in others."""

import time
from dataclasses import replace

import numpy as np
import pytest

from paramreduce_cli.terms.parallel_descents import NearbyStart, Restart, Searcher, start_searchers
from paramreduce_cli.terms.program_fitting import Budget


def found(searcher, start, jobs):
    told = []
    with start_searchers(searcher, jobs, lambda way: told.append(way.rank)) as working:
        ends = working.map(Searcher.descend, [start])
        ends += working.map(
            Searcher.descend_nearby, [NearbyStart(start, [start], turn) for turn in range(6)]
        )
        ends += working.map(Searcher.repeat_descent, [Restart(ends[k], k) for k in range(4)])
        close = working.map(Searcher.descend_closely, ends)
    assert sorted(told) == sorted(one.rank for one in ends + close)
    return [one.rank for one in ends + close]


def test_what_is_found_does_not_depend_on_the_number_of_processes(searcher, start):
    here = found(searcher, start, 1)
    assert found(searcher, start, 2) == here
    assert len(set(here)) > 1


@pytest.mark.parametrize("jobs", [1, 2])
def test_after_the_deadline_one_is_done_unless_all_are_asked_for(searcher, start, jobs):
    with start_searchers(searcher, jobs, lambda way: None, time.monotonic()) as working:
        assert len(working.map(Searcher.descend, [start] * 3, however_late=True)) == 3
        assert not working.cut_short
        assert len(working.map(Searcher.descend, [start] * 6)) == 1
        assert working.cut_short
        assert not working.is_in_time()


def test_what_is_at_the_edge_of_the_budget_may_be_out_of_it_near_there(searcher, start):
    exact = replace(searcher, budget=Budget(1e-18, np.inf))
    assert exact.descend_nearby(NearbyStart(start, [start], 0)) is None
    with start_searchers(exact, 1, lambda way: None) as working:
        assert working.map(Searcher.descend_nearby, [NearbyStart(start, [start], 0)]) == []
