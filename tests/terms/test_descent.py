"""From one start down: what is passed on the way keeps to what is said of it."""

from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import model_of
from terms.test_term_removal import states

from paramreduce_cli.lean.lean_models import LeanModels
from paramreduce_cli.reduction.models import make_base_model
from paramreduce_cli.terms.descent import (
    Descent,
    continue_on_samples,
    draw_history,
    drop_candidates,
    find_leanest_histories,
    list_front,
)
from paramreduce_cli.terms.fit_samples import make_samples
from paramreduce_cli.terms.program_fitting import Budget, Fitting
from paramreduce_cli.terms.starts import Start
from paramreduce_cli.terms.term_removal import NOISE, TermSearch

BUDGET = Budget(0.03, np.inf)


@pytest.fixture(scope="module")
def arm():
    return model_of("puma560")


def samples(model, count, seed):
    block = states(model, count, seed)
    nominal = np.sqrt(np.mean(block.tau**2, axis=0))
    return make_samples(
        model.mechanism, [block], nominal, np.ones(6), direct=False, projected=False
    )


@pytest.fixture(scope="module")
def begun(arm):
    base = make_base_model(arm)
    start = Start("base", base, 0.0, 0)
    program = start.build_program(LeanModels(arm), direct=False)
    looked_at = samples(arm, 100, 0)

    def made(seed=0):
        def searching(tape):
            return TermSearch(Fitting(tape, base.n, looked_at, BUDGET), seed)

        return Descent.start_from(start, program, searching)

    return made


def test_programs_on_the_way_have_the_errors_and_operations_that_are_said(arm, begun):
    descent = begun().descend()
    assert descent.fewest < 0.7 * max(descent.visited)
    looked_at = samples(arm, 100, 0)
    for count, passed in descent.visited.items():
        one = descent.rebuild(passed)
        assert one.program.n_operations <= count
        error, _ = looked_at.compute_errors(one.evaluate(looked_at.states))
        assert error == pytest.approx(passed.worst_ratio * BUDGET.torque, rel=1e-6, abs=1e-12)
        assert error <= BUDGET.torque


def test_with_all_terms_parameters_are_those_of_the_start_in_the_units_that_are_said(begun):
    one = begun()
    assert np.any(one.units != 1.0)
    whole = one.history.rebuild(one.visited[one.end.count])
    np.testing.assert_allclose(
        whole.beta * whole.units, one.start.model.values, rtol=1e-6, atol=1e-9
    )


def test_rewriting_on_the_way_is_no_worse_than_one_descent(begun):
    one = begun()
    assert one.descend().fewest <= one.search.descend(one.end).count


def test_noise_finds_other_ends_and_the_same_seed_the_same(begun):
    ends = [begun(seed).descend(NOISE) for seed in (1, 1, 2, 3, 4)]
    assert ends[0].rank == ends[1].rank
    assert len({one.rank for one in ends}) > 1
    best = find_leanest_histories(ends, 2)
    assert best[0].rank == min(one.rank for one in ends)
    assert best[0].rank != best[1].rank


def test_once_more_it_begins_shortly_before_the_end_with_the_same_function(arm, begun):
    first = begun()
    way = first.descend()
    looked_at = samples(arm, 100, 0)

    def again(turn):
        return Descent.restart(way, np.random.default_rng(turn), first.searching)

    known = np.array([passed.worst_ratio for passed in way.visited.values()])
    sizes = set()
    for turn in range(6):
        one = again(turn)
        assert one.end.count <= way.fewest / 0.88
        whole = one.history.rebuild(one.visited[one.end.count])
        error, _ = looked_at.compute_errors(whole.evaluate(looked_at.states))
        # That of a program on the way, whatever it is written in.
        assert np.abs(known * BUDGET.torque / error - 1).min() < 1e-6
        sizes.add(one.search.tape.size)
        # What was passed before stays, nothing beyond.
        assert min(one.visited) == one.end.count
        assert max(one.visited) == max(way.visited)
    assert len(sizes) > 1
    ends = [again(turn).descend().rank for turn in (0, 0, 1, 2)]
    assert ends[0] == ends[1]
    assert len(set(ends)) > 1


def test_leaner_ends_are_drawn_more_often():
    ends = [SimpleNamespace(fewest=fewest) for fewest in (104, 100, 102)]
    rng = np.random.default_rng(0)
    times = Counter(draw_history(ends, rng).fewest for _ in range(2000))
    # Each e times as often as the one of two operations more.
    assert times[100] / times[102] == pytest.approx(np.e, rel=0.2)
    assert times[102] / times[104] == pytest.approx(np.e, rel=0.2)


def test_on_other_samples_the_leanest_that_keeps_to_the_budget_is_gone_on_from(arm, begun):
    descent = begun().descend()
    other = samples(arm, 200, 5)

    def closer(budget):
        return lambda tape: TermSearch(Fitting(tape, descent.start.model.n, other, budget), 0)

    found = continue_on_samples(descent, closer(BUDGET))
    one = found.rebuild(found.visited[found.fewest])
    assert other.compute_errors(one.evaluate(other.states))[0] <= BUDGET.torque
    assert continue_on_samples(descent, closer(Budget(1e-14, np.inf))) is None


def test_a_front_has_programs_that_no_leaner_one_beats(arm, begun):
    descents = [begun(seed).descend(NOISE) for seed in (1, 2)]
    programs = list_front(descents)
    assert 3 <= len(programs) <= 16
    counts = [one.program.n_operations for one in programs]
    assert counts == sorted(counts)
    looked_at = samples(arm, 100, 0)
    errors = [looked_at.compute_errors(one.evaluate(looked_at.states))[0] for one in programs]
    assert np.all(np.diff(errors) < 0)


def test_of_exact_programs_a_front_has_the_leanest(begun):
    one = begun().history
    counts = sorted(one.visited)
    dearer = replace(one.visited[counts[0]], cost=0.0)
    way = replace(one, visited={counts[0]: replace(dearer, cost=1e-25), counts[0] + 9: dearer})
    assert [found.program for found in list_front([way])] == [way.rebuild(dearer).program]


def test_slimmed_ways_have_the_same_front_and_the_same_leanest_ends(begun):
    ways = [begun(seed).descend(NOISE) for seed in (1, 2, 3, 4)]
    slim = drop_candidates(ways, 2)
    assert [one.rank for one in slim] == [one.rank for one in ways]
    assert [len(one.visited) for one in find_leanest_histories(slim, 2)] == [
        len(one.visited) for one in find_leanest_histories(ways, 2)
    ]
    assert [one.program for one in list_front(slim)] == [one.program for one in list_front(ways)]
    # One program of every number of operations is enough.
    passed = {count for way in ways for count in way.visited}
    others = [way for way in slim if way.rank > find_leanest_histories(ways, 2)[-1].rank]
    assert sum(len(way.visited) for way in others) <= len(passed)
    assert drop_candidates(slim, 2) == slim
