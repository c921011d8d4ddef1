"""Searches for the best subsets of all sizes, and the proofs that they give."""

import contextlib
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from paramreduce_cli.errors import ParamreduceError
from paramreduce_cli.multibody.orthogonal import select_independent
from paramreduce_cli.records import IntArray, Progress, Proofs, ProofStatus
from paramreduce_cli.reduction.best_subset.parts import PartedSearch
from paramreduce_cli.reduction.best_subset.subset_search import (
    BEGINNING,
    RESOLUTION,
    GroupedProblem,
    Search,
    compile_search,
    normalise_problem,
)
from paramreduce_cli.reduction.best_subset.ties import find_first_tie
from paramreduce_cli.reduction.objective import Objective, Subset
from paramreduce_cli.reduction.problem import FULL_PRECISION
from paramreduce_cli.reduction.task import SelectionTask

_FIRST_SLICE, _LARGEST_SLICE = 200, 20_000
"""Nodes between two looks at the clock: few at first, as those of nearly dependent columns take long,"""
_PATIENCE = 0.5
"""and then as many as pass in this time, s."""
_FIRST_ROUND, _GROWTH = 30_000, 8
"""Nodes for each size in the first round, and how many times more in each further one."""
_UNLIMITED = 10**15
_WORTH_KEEPING = 1.0
"""Seconds of a search from which on its end is kept at once."""
_LONG = 3.0
"""Long of a compilation, s: longer than to load what has been compiled before."""
_SHARES = (0.1, 0.25, 0.5, 0.7, 0.85)
"""Shares of the best error, that are tried as lower bounds where the optimum is not proven."""
_NODES_PER_SHARE = 30_000
_SHARE_OF_TIME, _LEAST_TIME = 0.1, 2.0
"""Of the time limit, and s, that lower bounds may take after it."""


@dataclass
class _Proof:
    """The state of the proof of one size; errors are squared shares of chi."""

    n: int
    exact: IntArray
    """A subset of just this size, for groups do not fill every size as well as a smaller one."""
    subset: IntArray
    """The best one of at most this size."""
    squared_error: float
    start: tuple[float, IntArray]
    """Error and subset that all jobs start from, whatever they have found since."""
    squared_bound: float = 0.0
    status: ProofStatus = ProofStatus.BEST_FOUND
    seconds: float = 0.0
    nodes: int = 0
    log: IntArray = field(default_factory=BEGINNING.copy)
    dealt: int = 0

    def take(self, subset: IntArray, squared_error: float) -> None:
        """Remember a better subset."""
        self.subset, self.squared_error = subset, squared_error
        if subset.size == self.n:
            self.exact = subset


class ProofSearch:
    """A search for the best subsets of all sizes, as many sizes at a time as there are threads.

    Args:
        task: Task of the heuristic.
        starts: Subsets of columns to start from, one of every size.
    """

    def __init__(self, task: SelectionTask, starts: Iterable[IntArray]) -> None:
        self._task = task
        self._objective: Objective = task.objective
        self._problem: GroupedProblem = normalise_problem(task.objective.problem)
        self._place = {int(column): k for k, column in enumerate(self._problem.columns)}
        self._proofs: dict[int, _Proof] = {}
        self._spent: dict[int, int] = {}
        self._by_subtrees: bool = task.effort.subtrees and not task.part.is_whole
        for columns in starts:
            self._add_start(self._number_columns(columns))
        if task.previous is not None:
            self._remember(task.previous)
        self._share_with_neighbours()

    def _number_columns(self, columns: IntArray) -> IntArray:
        return np.array([self._place[int(c)] for c in columns], dtype=np.int64)

    def _compute_squared_error(self, subset: IntArray) -> float:
        return self._objective.score(self._find_groups(subset)) ** 2

    def _find_groups(self, subset: IntArray) -> Subset:
        return self._objective.find_groups(self._problem.columns[subset])

    def _add_start(self, subset: IntArray) -> None:
        """Begin the proof of a size from a subset."""
        error = self._compute_squared_error(subset)
        self._proofs[subset.size] = _Proof(subset.size, subset, subset, error, (error, subset))

    def _remember(self, previous: Proofs) -> None:
        """Take over what an earlier run has found and proven on the same groups."""
        same = len(previous.units) == len(self._objective.groups) and all(
            np.array_equal(a, b)
            for a, b in zip(previous.units, self._objective.groups, strict=True)
        )
        for k, n in enumerate(previous.n.tolist() if same else []):
            proof = self._proofs.get(n)
            if proof is None:
                continue
            subset = self._number_columns(previous.subsets[k])
            error = self._compute_squared_error(subset)
            if error < proof.squared_error:
                proof.take(subset, error)
            if previous.dealt[k] and not self._by_subtrees:
                continue  # of a share of the tree
            proof.squared_bound = float(previous.lower_bound[k]) ** 2
            unfinished = previous.status[k] is ProofStatus.BEST_FOUND
            if unfinished and self._by_subtrees and not previous.dealt[k]:
                continue  # its log is of the whole tree, which jobs are to split
            proof.status, proof.log = previous.status[k], previous.logs[k]
            proof.seconds, proof.nodes = float(previous.seconds[k]), int(previous.nodes[k])
            proof.dealt = int(previous.dealt[k])

    def run(self) -> None:
        """Search until all is proven, or time or nodes run out, or the user has enough.

        The search proceeds in rounds of growing effort, so that easy proofs do not wait for hard ones.
        """
        self._compile()
        stop = threading.Event()
        deadline = time.monotonic() + self._task.effort.time_limit
        budget = _FIRST_ROUND
        limit = self._task.effort.node_limit or _UNLIMITED
        with ThreadPoolExecutor(self._task.effort.jobs) as pool:
            try:
                while time.monotonic() < deadline and self._list_open():
                    self._round(pool, min(budget, limit), deadline, stop)
                    if budget >= limit:
                        break
                    budget *= _GROWTH
                more = max(_LEAST_TIME, _SHARE_OF_TIME * self._task.effort.time_limit)
                if not self._by_subtrees:  # a bound of a share of a tree is none of its size
                    self._raise_bounds(pool, time.monotonic() + more, stop)
            except KeyboardInterrupt:
                stop.set()
                self._task.interrupted()
        self._share_with_neighbours()

    def _compile(self) -> None:
        """Compile the search, and say so where that has not been done on this machine before."""
        announced = threading.Event()

        def report(done: int) -> None:
            """Report the progress of compiling."""
            announced.set()
            what = "compile the search for best subsets, once for all runs"
            self._task.progress(Progress(what, done, 1))

        late = threading.Timer(_LONG, report, (0,))
        late.start()
        compile_search()
        late.cancel()
        if announced.is_set():
            report(1)

    def _list_open(self) -> list[_Proof]:
        """Return the sizes of this job that are not proven yet."""
        sizes = sorted(self._proofs)
        return [
            proof
            for n in (sizes if self._by_subtrees else self._task.part.select(sizes))
            if (proof := self._proofs[n]).status == ProofStatus.BEST_FOUND
            and proof.squared_error > FULL_PRECISION**2
        ]

    def _round(
        self, pool: ThreadPoolExecutor, budget: int, deadline: float, stop: threading.Event
    ) -> None:
        """Search for every size that is open up to a number of nodes in all."""
        waiting = self._list_open()

        def work(proof: _Proof) -> None:
            """Search for one size until its slice of nodes or the time is used up."""
            if stop.is_set() or time.monotonic() > deadline:
                return  # to deal subtrees alone would take a while
            before = self._spent.get(proof.n, 0)
            search = self._start_search(proof)
            for nodes in self._iterate_slices(proof, search, budget - before, deadline, stop):
                search.advance(nodes, self._count_threads(len(waiting)))
                self._share_incumbents(proof, search)
            self._spent[proof.n] = before + search.nodes
            self._take_over(proof, search)
            if proof.status != ProofStatus.BEST_FOUND and proof.seconds > _WORTH_KEEPING:
                self._task.keep(self._make_record([proof]))
            waiting.remove(proof)

        shown = -1
        for future in as_completed([pool.submit(work, proof) for proof in self._list_open()]):
            future.result()
            done = len(self._proofs) - len(self._list_open())
            if done != shown:
                detail = f"{done} of {len(self._proofs)} sizes"
                self._task.progress(Progress("best-subset", done, len(self._proofs), detail))
                shown = done

    def _count_threads(self, waiting: int) -> int:
        """Return the number of threads for one size, given the number of sizes that wait.

        With a limit on nodes the number is one, so that every machine stops at the same node.
        """
        effort = self._task.effort
        return 1 if effort.node_limit else max(1, effort.jobs // waiting)

    def _start_search(self, proof: _Proof, factor: float = 1.0) -> PartedSearch:
        """Return the search of a size, continued from its log or split into this job's subtrees."""
        dealing = self._by_subtrees and not proof.log.size
        known = proof.start if dealing else (proof.squared_error, proof.subset)

        def part(log: IntArray) -> Search:
            return Search(self._problem, proof.n, *known, factor, log)

        search = PartedSearch(part, proof.log if factor == 1.0 else BEGINNING)
        if dealing:
            proof.dealt = search.deal(self._task.part)
            search.take_incumbent(proof.squared_error, proof.subset)
        return search

    def _share_incumbents(self, proof: _Proof, search: PartedSearch) -> None:
        """Tell other jobs of a better subset, or hear of one; what is heard is calculated anew."""
        key = f"incumbent-{proof.n:04d}"
        incumbent = self._task.incumbents.get(key, proof.subset[:0])
        usable = 0 < incumbent.size <= proof.n and set(incumbent.tolist()) <= self._place.keys()
        subset = self._number_columns(incumbent) if usable else proof.subset
        known = self._compute_squared_error(subset) if usable else proof.squared_error
        if known < search.squared_error * (1 - RESOLUTION):
            search.take_incumbent(known, subset)
        elif search.squared_error < known * (1 - RESOLUTION):
            with contextlib.suppress(ParamreduceError):  # nothing is lost but time of other jobs
                self._task.incumbents[key] = self._problem.columns[search.subset]

    def _iterate_slices(
        self, proof: _Proof, search: PartedSearch, nodes: int, deadline: float,
        stop: threading.Event,
    ) -> Iterator[int]:  # fmt: skip
        """Yield the numbers of nodes to search next, until there is a reason to stop."""
        started = time.perf_counter()
        before = search.nodes
        slice_ = _FIRST_SLICE
        while search.nodes < nodes and not (search.finished or stop.is_set()):
            if time.monotonic() > deadline:
                break
            yield min(slice_, nodes - search.nodes)
            rate = (search.nodes - before) / (time.perf_counter() - started)
            slice_ = min(_LARGEST_SLICE, max(1, int(_PATIENCE * rate)))
        proof.seconds += time.perf_counter() - started

    def _raise_bounds(
        self, pool: ThreadPoolExecutor, deadline: float, stop: threading.Event
    ) -> None:
        """Prove at least that the error cannot be a fraction of the best one.

        A search for much smaller errors ends much sooner.
        """

        def work(proof: _Proof) -> None:
            """Raise the bound of one size by searches for much smaller errors."""
            known = np.sqrt(proof.squared_bound / proof.squared_error)
            for fraction in (fraction for fraction in _SHARES if fraction > known):
                search = self._start_search(proof, factor=fraction**2)
                for nodes in self._iterate_slices(proof, search, _NODES_PER_SHARE, deadline, stop):
                    search.advance(nodes, threads=1)
                if not search.finished or not self._is_certain(search):
                    return
                proof.squared_bound = max(proof.squared_bound, search.bound)

        list(pool.map(work, self._list_open()))

    def _is_certain(self, search: PartedSearch) -> bool:
        """Return whether round-off leaves no doubt about what a search proves."""
        clear = self._objective.problem.certifiable and self._problem.certifiable
        return clear and not search.is_uncertain

    @cached_property
    def _least_error(self) -> float:
        """Squared error of all columns together."""
        return self._objective.score(tuple(range(len(self._objective.groups)))) ** 2

    @cached_property
    def _rank(self) -> int:
        """Rank of the candidates' columns."""
        problem = self._objective.problem
        return len(select_independent(problem.W, problem.candidates_by_preference))

    def _take_over(self, proof: _Proof, search: PartedSearch) -> None:
        """Note how far a search has come."""
        if search.squared_error < proof.squared_error and search.subset.size:
            first = find_first_tie(self._problem, search.subset, search.squared_error)
            better = self._fill_up(first, proof.n)
            proof.take(better, self._compute_squared_error(better))
        proof.nodes += search.nodes
        certain = self._is_certain(search)
        if certain:
            proof.squared_bound = max(proof.squared_bound, min(search.bound, proof.squared_error))
        proof.log = search.log
        if search.finished or not certain:
            proof.status = ProofStatus.OPTIMAL if certain else ProofStatus.UNCERTIFIED
        if proof.status == ProofStatus.OPTIMAL:
            proof.squared_bound = proof.squared_error

    def _fill_up(self, subset: IntArray, n: int) -> IntArray:
        """Return a subset with further groups added, as long as columns are left."""
        kept = self._find_groups(subset)
        for group in range(len(self._objective.groups)):
            longer = (*kept, group)
            if group not in kept and self._objective.count_columns(longer) <= n:
                kept = longer
        return self._number_columns(self._objective.list_columns(kept))

    def _share_with_neighbours(self) -> None:
        """Apply what holds for one size to its neighbours.

        A subset holds for all larger sizes, and a bound for all smaller ones. If nothing is left to explain, there is
        nothing to prove.
        """
        before: _Proof | None = None
        for _, proof in sorted(self._proofs.items()):
            if before is not None and before.squared_error < proof.squared_error:
                proof.subset, proof.squared_error = before.subset, before.squared_error
            before = proof
        bound = 0.0
        for _, proof in sorted(self._proofs.items(), reverse=True):
            if proof.squared_error <= FULL_PRECISION**2:
                proof.status = ProofStatus.OPTIMAL
            if not self._by_subtrees:
                proof.squared_bound = bound = max(bound, proof.squared_bound)

    def list_subsets(self) -> list[Subset]:
        """Return the best subset found of exactly each size, after :meth:`run`."""
        return [self._find_groups(proof.exact) for proof in self._proofs.values()]

    def record(self) -> Proofs:
        """Return all proofs by size."""
        return self._make_record([self._proofs[n] for n in sorted(self._proofs)])

    def _make_record(self, proofs: Sequence[_Proof]) -> Proofs:
        """Return the proofs of some sizes as a record."""
        rank = self._rank

        def find_status(proof: _Proof) -> ProofStatus:
            """Return the status of a proof, also of sizes beyond the rank."""
            done = (
                proof.status == ProofStatus.OPTIMAL
                and proof.n > rank
                and proof.squared_error <= self._least_error * (1 + RESOLUTION) + FULL_PRECISION**2
            )
            return ProofStatus.BEYOND_RANK if done else proof.status

        return Proofs(
            units=tuple(self._objective.groups),
            n=np.array([p.n for p in proofs]),
            subsets=tuple(self._problem.columns[p.subset] for p in proofs),
            torque_error=np.sqrt([p.squared_error for p in proofs]),
            lower_bound=np.sqrt([p.squared_bound for p in proofs]),
            status=tuple(map(find_status, proofs)),
            seconds=np.array([p.seconds for p in proofs]),
            nodes=np.array([p.nodes for p in proofs], dtype=np.int64),
            logs=tuple(p.log for p in proofs),
            dealt=np.array([p.dealt for p in proofs], dtype=np.int64),
        )
