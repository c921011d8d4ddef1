"""Proofs against exhaustive search, and searches that are stopped and continued."""

import dataclasses
import itertools

import numpy as np
import pytest
from oracles.selection import all_best_errors, error_by_definition
from selecting import Effort, dependent_problem, found, problem

from paramreduce_cli.errors import DataError
from paramreduce_cli.records import WHOLE, Part, ProofStatus
from paramreduce_cli.reduction.best_subset import kernel, parts
from paramreduce_cli.reduction.best_subset.merging import join_subtrees, merge_proofs
from paramreduce_cli.reduction.best_subset.parts import PartedSearch
from paramreduce_cli.reduction.best_subset.proofs import ProofSearch
from paramreduce_cli.reduction.best_subset.subset_search import BEGINNING, Search, normalise_problem
from paramreduce_cli.reduction.best_subset.ties import find_first_tie
from paramreduce_cli.reduction.criteria.torque import TorqueObjective
from paramreduce_cli.reduction.heuristics import swap
from paramreduce_cli.reduction.task import SelectionTask, run

KINDS = ("generic", "sparse", "proportional", "dependent", "near-dependent", "nearly-parallel")


def case(kind, rng):
    """Up to 13 columns of very different sizes; half of the time with noise."""
    m = int(rng.integers(3, 14))
    rows = m + int(rng.integers(0, 6))
    W = rng.normal(size=(rows, m))
    if kind == "sparse":
        W = W * (rng.random((rows, m)) < 0.35)
    if kind == "proportional":
        for _ in range(int(rng.integers(1, 4))):
            i, j = rng.choice(m, 2, replace=False)
            W[:, i] = W[:, j] * rng.choice([-1, 1, 2.5, -0.01])
    if kind in ("dependent", "near-dependent"):
        rank = int(rng.integers(2, max(3, m - 1)))
        W = rng.normal(size=(rows, rank)) @ rng.normal(size=(rank, m))
    if kind == "near-dependent":
        W = W + 10.0 ** -rng.uniform(1, 3) * rng.normal(size=(rows, m))
    if kind == "nearly-parallel":  # the spectrum of W does not show it
        i, j, k = rng.choice(m, 3, replace=False)
        W[:, i] = W[:, j] + 10.0 ** -rng.uniform(1, 4) * W[:, k]
    empty = np.linalg.norm(W, axis=0) == 0
    W[:, empty] = rng.normal(size=(rows, int(empty.sum())))
    W = W * 10.0 ** rng.uniform(-3, 3, m)
    chi = W @ (rng.normal(size=m) / np.linalg.norm(W, axis=0) * 10.0 ** rng.uniform(-3, 0, m))
    if rng.random() < 0.5:
        chi = chi + 0.1 * np.linalg.norm(chi) * rng.normal(size=rows) / np.sqrt(rows)
    return W, chi


@pytest.mark.parametrize("part", range(8))
def test_exhaustive_search_agrees(part):
    """800 cases in all; a bare search, without a good subset to start from."""
    rng = np.random.default_rng(part)
    uncertain = 0
    for k in range(100):
        W, chi = case(KINDS[k % len(KINDS)], rng)
        m = W.shape[1]
        p = normalise_problem(problem(W, chi, preference=rng.permutation(m)))
        best = all_best_errors(W, chi)
        for n in range(1, m + 1):
            search = Search(p, n, 1.0, np.zeros(0, np.int64))
            search.advance(10**6)
            assert search.finished
            if not p.certifiable:
                uncertain += 1
                continue
            assert np.sqrt(search.squared_error) == pytest.approx(best[n], rel=1e-6, abs=1e-8)
            if best[n] < 1:
                error = error_by_definition(p.X, p.chi, search.subset)
                assert error == pytest.approx(best[n], rel=1e-6, abs=1e-8)
    assert uncertain < 20  # sizes, of about 800


def hard_problem():
    return dependent_problem(0, rank=26, columns=30)


def start(p, n):
    """A subset that is not the best, and its squared error."""
    subset = np.arange(n)
    return error_by_definition(p.X, p.chi, subset) ** 2, subset


def test_a_search_can_be_stopped_anywhere_and_continued():
    p = normalise_problem(hard_problem())
    whole = Search(p, 8, *start(p, 8))
    whole.advance(10**9)
    log, error, subset, nodes = np.zeros(0, np.int64), *start(p, 8), 0
    while True:
        part = Search(p, 8, error, subset, log=log)
        part.advance(37)
        log, error, subset, nodes = part.log, part.squared_error, part.subset, nodes + part.nodes
        if part.finished:
            break
        assert part.bound <= whole.squared_error * (1 + 1e-9)
    assert error == pytest.approx(whole.squared_error, rel=1e-9)
    assert whole.nodes > 300
    assert whole.nodes <= nodes < 2 * whole.nodes


@pytest.mark.parametrize("threads", [1, 3])
def test_parts_of_a_search_find_and_prove_what_it_does_alone_and_can_be_continued(threads):
    p = normalise_problem(hard_problem())
    whole = Search(p, 8, *start(p, 8))
    whole.advance(10**9)
    log, error, subset, nodes = BEGINNING, *start(p, 8), 0
    while True:
        parted = PartedSearch(lambda log: Search(p, 8, error, subset, log=log), log)  # noqa: B023
        for _ in range(4):
            if not parted.finished:
                parted.advance(23, threads)
        log, error, subset, nodes = (
            parted.log,
            parted.squared_error,
            parted.subset,
            nodes + parted.nodes,
        )
        assert (log.size == 0) == parted.finished
        assert parted.bound <= whole.squared_error * (1 + 1e-9)
        if parted.finished:
            break
    assert error == pytest.approx(whole.squared_error, rel=1e-9)
    assert parted.bound == pytest.approx(whole.squared_error, rel=1e-6)
    assert whole.nodes <= nodes < 2 * whole.nodes


def test_a_split_search_leaves_nothing_out():
    """Every part is searched alone for a subset worse than the best: one of them finds the best."""
    p = normalise_problem(hard_problem())
    whole = Search(p, 8, *start(p, 8))
    whole.advance(10**9)
    for ahead in (1, 20, 150):
        own = Search(p, 8, *start(p, 8))
        own.advance(ahead)
        parts = [own, own.split(), *([own.split()] if ahead > 1 else [])]
        known = own.squared_error
        for part in parts:
            part.advance(10**9)
        assert min(part.squared_error for part in parts) == pytest.approx(whole.squared_error)
        assert whole.squared_error < known
        assert all(part.split() is None for part in parts)


@pytest.mark.parametrize("many", [1, 4, 100])
def test_subtrees_dealt_to_jobs_leave_nothing_out(monkeypatch, many):
    """Each job searches its own alone; one of them finds the best, and none does the work of all."""
    monkeypatch.setattr(parts, "_SUBTREES", many)
    monkeypatch.setattr(parts, "_MOST_SUBTREES", 200)
    monkeypatch.setattr(parts, "_EASY", 1)
    p = normalise_problem(hard_problem())
    whole = Search(p, 8, *start(p, 8))
    whole.advance(10**9)
    jobs = [PartedSearch(lambda log: Search(p, 8, *start(p, 8), log=log), BEGINNING) for _ in "123"]
    digests = {job.deal(Part(number, 3)) for number, job in enumerate(jobs, 1)}
    assert len(digests) == 1
    logs = [set(map(bytes, parts.split_log(job.log))) - {b""} for job in jobs]
    assert not logs[0] & logs[1] | logs[1] & logs[2] | logs[0] & logs[2]
    for job in jobs:
        while not job.finished:
            job.advance(10**6, threads=1)
    assert min(job.squared_error for job in jobs) == pytest.approx(whole.squared_error, rel=1e-9)
    if many == 4:
        assert max(job.nodes for job in jobs) < 0.8 * whole.nodes


def shares_of(problem, count, **effort):
    """What jobs prove of the same, each of its subtrees."""
    wanted = Effort(subtrees=True, **effort)
    for number in range(1, count + 1):
        yield found("best-subset", problem, part=Part(number, count), effort=wanted).proofs


def tied_problem(seed):
    """Two columns in the span of two others each, so that many subsets span the same space."""
    rng = np.random.default_rng(seed)
    W = rng.normal(size=(40, 12))
    W[:, [2, 9]] = W[:, [4, 7]] @ rng.normal(size=(2, 2))
    W[:, [0, 11]] = W[:, [3, 8]] @ rng.normal(size=(2, 2))
    return problem(W, W[:, [4, 7, 3, 8, 5]] @ [1, -2, 1.5, 2, 0.3] + rng.normal(size=40))


@pytest.mark.parametrize("seed", range(4))
def test_of_subsets_as_good_as_each_other_the_first_is_found_from_any(seed):
    given = tied_problem(seed)
    own = normalise_problem(given)
    for n in (2, 4, 5):
        errors = {
            kept: error_by_definition(own.X, own.chi, kept) ** 2
            for kept in itertools.combinations(range(12), n)
        }
        best = min(errors.values())
        ties = [kept for kept, error in errors.items() if error <= best * (1 + 1e-10)]
        for kept in ties:
            found_first = find_first_tie(own, np.array(kept), errors[kept])
            assert tuple(found_first) == min(ties)
        if n > 2:
            assert len(ties) > 5


@pytest.mark.parametrize("seed", range(4))
def test_jobs_and_threads_find_the_same_of_subsets_as_good_as_each_other(monkeypatch, seed):
    monkeypatch.setattr(parts, "_SUBTREES", 4)
    monkeypatch.setattr(parts, "_EASY", 1)
    given = tied_problem(seed)
    poor = [np.arange(12 - n, 12) for n in range(1, 13)]

    def proofs(share=WHOLE, **effort):
        search = ProofSearch(
            SelectionTask(TorqueObjective(given), part=share, effort=Effort(**effort)), poor
        )
        search.run()
        return search.record()

    whole = proofs()
    together = join_subtrees([proofs(Part(number, 3), subtrees=True) for number in (1, 2, 3)])
    for other in (together, proofs(jobs=2)):
        assert [kept.tolist() for kept in other.subsets] == [
            kept.tolist() for kept in whole.subsets
        ]


@pytest.mark.parametrize("limit", [None, 40])
def test_proofs_of_subtrees_are_one_proof_together_that_can_be_gone_on_with(monkeypatch, limit):
    monkeypatch.setattr(parts, "_SUBTREES", 4)
    monkeypatch.setattr(parts, "_EASY", 1)
    given = hard_problem()
    whole = found("best-subset", given).proofs
    shares = list(shares_of(given, 3, node_limit=limit))
    together = join_subtrees(shares)
    assert np.all(together.lower_bound <= whole.torque_error * (1 + 1e-9))
    for one in shares:
        assert np.all(together.torque_error <= one.torque_error * (1 + 1e-9))
    if limit:
        assert "best-found" in set(together.status)
        together = found("best-subset", given, previous=together).proofs
    assert set(together.status) == {"optimal", "beyond-rank"}
    np.testing.assert_allclose(together.torque_error, whole.torque_error, rtol=1e-9, atol=1e-12)
    assert not together.dealt.any()


def test_what_some_job_has_not_begun_is_not_proven(monkeypatch):
    """Its subtrees are in nobody's log: the search begins anew."""
    monkeypatch.setattr(parts, "_SUBTREES", 4)
    monkeypatch.setattr(parts, "_EASY", 1)
    given = hard_problem()
    busy = next(shares_of(given, 2, node_limit=40))
    idle = next(shares_of(given, 2, time_limit=0.0))
    together = join_subtrees([busy, idle])
    open_ = [row for row, log in enumerate(busy.logs) if log.size]
    assert open_
    for row in open_:
        assert together.status[row] == "best-found"
        assert together.logs[row].size == 0
        assert together.lower_bound[row] == 0
    done = found("best-subset", given, previous=together).proofs
    whole = found("best-subset", given).proofs
    assert set(done.status) == {"optimal", "beyond-rank"}
    np.testing.assert_allclose(done.torque_error, whole.torque_error, rtol=1e-9, atol=1e-12)


def test_a_job_that_knows_more_is_dealt_the_same(monkeypatch):
    """What it has found before does not change how it splits."""
    monkeypatch.setattr(parts, "_SUBTREES", 4)
    monkeypatch.setattr(parts, "_EASY", 1)
    given = hard_problem()
    whole = found("best-subset", given).proofs
    known = dataclasses.replace(
        whole,
        status=tuple(ProofStatus.BEST_FOUND for _ in whole.n),
        lower_bound=np.zeros_like(whole.lower_bound),
    )
    dealt = []
    for previous in (None, known):
        task = SelectionTask(
            TorqueObjective(given), part=Part(1, 2), previous=previous,
            effort=Effort(subtrees=True, node_limit=5),
        )  # fmt: skip
        search = ProofSearch(task, [np.arange(n) for n in whole.n])
        search.run()
        dealt.append(search.record().dealt)
    assert np.array_equal(*dealt)
    assert np.count_nonzero(dealt[0]) > 5


def test_jobs_that_split_differently_are_not_put_together(monkeypatch):
    monkeypatch.setattr(parts, "_SUBTREES", 4)
    monkeypatch.setattr(parts, "_EASY", 1)
    shares = list(shares_of(hard_problem(), 2))
    other = dataclasses.replace(shares[1], dealt=shares[1].dealt + 1)
    with pytest.raises(DataError, match=r"the 2 parts have not split .*subset\.parts: sizes"):
        join_subtrees([shares[0], other])


def test_jobs_tell_each_other_what_they_find():
    given = hard_problem()
    best = found("best-subset", given).proofs
    poor = [np.arange(n) for n in best.n]
    task = SelectionTask(TorqueObjective(given), effort=Effort(node_limit=3))
    task.incumbents["incumbent-0008"] = best.subsets[7]
    heard = ProofSearch(task, poor)
    heard.run()
    assert heard.record().torque_error[7] == pytest.approx(best.torque_error[7])
    assert heard.record().torque_error[8] > 1.01 * best.torque_error[8]
    task = SelectionTask(TorqueObjective(given))
    ProofSearch(task, poor).run()
    assert sorted(task.incumbents["incumbent-0008"]) == sorted(best.subsets[7])


def test_a_search_for_less_proves_a_lower_bound():
    p = normalise_problem(hard_problem())
    whole = Search(p, 8, *start(p, 8))
    whole.advance(10**9)
    quick = Search(p, 8, whole.squared_error, whole.subset, factor=0.25)
    quick.advance(10**9)
    assert quick.nodes < whole.nodes / 2
    assert quick.bound == pytest.approx(0.25 * whole.squared_error, rel=1e-6)


def test_what_is_proven_is_kept_when_nodes_run_out_and_a_later_run_proves_more():
    p = hard_problem()
    optimum = found("best-subset", p, largest=8).proofs
    assert set(optimum.status) == {"optimal"}
    before, runs = None, 0
    while before is None or "best-found" in before.status:
        effort = Effort(node_limit=400, kicks=0)
        now = found("best-subset", p, largest=8, effort=effort, previous=before).proofs
        assert np.all(now.lower_bound <= optimum.torque_error * (1 + 1e-9) + 1e-12)
        assert np.all(now.lower_bound <= now.torque_error * (1 + 1e-9))
        assert np.all(now.torque_error >= optimum.torque_error * (1 - 1e-6) - 1e-12)
        if before is not None:
            assert now.nodes.sum() > before.nodes.sum()
            done = np.array(before.status) == "optimal"
            assert np.all(np.array(now.status)[done] == "optimal")
        before, runs = now, runs + 1
    assert runs > 2
    assert before.torque_error == pytest.approx(optimum.torque_error, rel=1e-6, abs=1e-12)


def test_without_any_time_there_are_subsets_and_bounds():
    p = hard_problem()
    result = found("best-subset", p, effort=Effort(time_limit=0.0))
    optimum = found("best-subset", p).proofs
    assert [s.size for s in result.subsets] == list(range(1, 31))
    assert "best-found" in result.proofs.status
    assert np.all(result.proofs.lower_bound <= optimum.torque_error * (1 + 1e-9) + 1e-12)
    assert result.proofs.lower_bound.max() > 0


def test_an_interruption_ends_the_search_and_keeps_what_is_known():
    told = []

    def interrupt(step):
        if step.task == "best-subset":
            raise KeyboardInterrupt

    asked = {"progress": interrupt, "interrupted": lambda: told.append(1)}
    result = found("best-subset", hard_problem(), **asked)
    assert told == [1]
    assert len(result.subsets) == 30


def test_a_decomposition_that_does_not_converge_leaves_the_bound_as_it_was(monkeypatch):
    def diverging(*_, **__):
        raise ValueError("Internal algorithm failed to converge.")

    search = Search(normalise_problem(hard_problem()), 3, 1.0, np.zeros(0, np.int64))
    state = search._state
    sheet, numbers, errors = state.sheets[0], state.numbers[0], state.errors[0].copy()
    before = sheet.copy()
    monkeypatch.setattr(np.linalg, "svd", diverging)
    kernel._refit.py_func(sheet, numbers, state.errors[0], state, search._data)
    assert (
        numbers[kernel.NEAR] == 1
    )  # so nothing is included by force, and the next exclusion tries again
    assert state.errors[0].tolist() == errors.tolist()
    assert np.array_equal(sheet, before)


def test_what_swaps_find_is_not_looked_for_twice(monkeypatch):
    times, original = [], swap.swap
    monkeypatch.setattr(swap, "swap", lambda task: times.append(1) or original(task))
    task = SelectionTask(TorqueObjective(dependent_problem(0)))
    started = run("swap", task)
    proven = run("best-subset", task)
    assert times == [1]
    assert len(proven.subsets) >= len(started.subsets)


@pytest.mark.parametrize("condition", [1e6, 1e8])
def test_what_double_precision_cannot_tell_is_not_called_optimal(condition):
    rng = np.random.default_rng(0)
    W = np.linalg.qr(rng.normal(size=(40, 9)))[0]
    W[:, 8] = W[:, 0] + W[:, 8] / condition
    result = found("best-subset", problem(W, W @ rng.normal(size=9))).proofs
    assert set(result.status[:8]) == {"uncertified"}
    assert np.all(result.lower_bound[:8] == 0)
    assert [s.size for s in result.subsets] == list(range(1, 10))


def test_duplicates_and_columns_beyond_the_rank():
    rng = np.random.default_rng(1)
    base = rng.normal(size=(30, 4))
    W = np.column_stack([base, base, -2 * base[:, :2]])
    proofs = found("best-subset", problem(W, base @ [1.0, 2.0, 3.0, 4.0])).proofs
    assert proofs.status == ("optimal",) * 4 + ("beyond-rank",) * 6
    best = all_best_errors(W, base @ [1.0, 2.0, 3.0, 4.0])
    assert proofs.torque_error == pytest.approx(best[1:], abs=1e-12)


def test_one_column_alone():
    W = np.arange(1.0, 6.0)[:, None]
    proofs = found("best-subset", problem(W, np.ones(5))).proofs
    assert proofs.status == ("optimal",)
    assert proofs.torque_error == pytest.approx([error_by_definition(W, np.ones(5), [0])])


@pytest.mark.parametrize("seed", [3, 51, 58])
def test_columns_of_which_round_off_leaves_nothing_end_no_search(seed):
    """Nearly dependent columns in units 1e18 apart; two of these divided by zero once."""
    rng = np.random.default_rng(seed)
    W = rng.normal(size=(40, 7)) @ rng.normal(size=(7, 14))
    W[:, :9] += 10.0 ** rng.uniform(-12, -3, size=9) * rng.normal(size=(40, 9))
    W *= 10.0 ** rng.uniform(-9, 9, size=14)
    chi = W @ (rng.normal(size=14) / np.linalg.norm(W, axis=0)) + 1e-6 * rng.normal(size=40)
    proofs = found("best-subset", problem(W, chi), effort=Effort(node_limit=20_000)).proofs
    assert np.all(proofs.lower_bound <= proofs.torque_error)


def test_sizes_of_groups_above_the_rank_are_proven_where_some_columns_still_help():
    """Six pairs whose first columns span three dimensions and whose second ones three others."""
    rng = np.random.default_rng(2)
    W = rng.normal(size=(40, 6)) @ rng.normal(size=(6, 12))
    given = problem(W, rng.normal(size=40) + W[:, 0], groups=[(k, k + 6) for k in range(6)])
    proofs = found("best-subset", given).proofs
    least = proofs.torque_error[-1]
    for n, error, status in zip(proofs.n, proofs.torque_error, proofs.status, strict=True):
        assert (status == "beyond-rank") == (n > 6 and error <= least * (1 + 1e-9))


def test_of_equal_proofs_the_furthest_search_is_kept():
    given = hard_problem()
    limited = [found("best-subset", given, effort=Effort(node_limit=k)).proofs for k in (40, 80)]
    for proofs in (limited, limited[::-1]):
        together = merge_proofs(proofs)
        for n, log, status in zip(together.n, together.logs, together.status, strict=True):
            if status == "best-found" and np.array_equal(
                *(one.get_size(n).lower_bound for one in limited)
            ):
                assert np.array_equal(log, limited[1].get_size(n).logs[0])


def test_jobs_split_a_search_that_an_earlier_artifact_has_begun():
    """What was found and bounded is taken over, where it stood is not, as it is in nobody's subtrees."""
    earlier = found("best-subset", hard_problem(), effort=Effort(node_limit=40)).proofs
    assert "best-found" in earlier.status
    jobs = [
        found(
            "best-subset", hard_problem(), previous=earlier, part=Part(number, 2),
            effort=Effort(subtrees=True),
        ).proofs
        for number in (1, 2)
    ]  # fmt: skip
    together = join_subtrees(jobs)
    alone = found("best-subset", hard_problem()).proofs
    assert together.status == alone.status
    assert np.allclose(together.torque_error, alone.torque_error, rtol=1e-9)
    open_ones = np.array([status == "best-found" for status in earlier.status])
    assert any(one.dealt[open_ones].any() for one in jobs)
