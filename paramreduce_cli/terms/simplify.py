"""The leanest program of one function within a budget of errors, found by leaving terms out."""

from __future__ import annotations

import heapq
import itertools
import threading
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from paramreduce_cli.expressions.factoring import Written, least
from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.expressions.operations import Program
from paramreduce_cli.lean.model import LeanModels
from paramreduce_cli.records import NOT_KEPT, FloatArray, ReducedModel
from paramreduce_cli.terms.fitting import Budget, Fitting
from paramreduce_cli.terms.samples import TermSamples
from paramreduce_cli.terms.search import Search, Step
from paramreduce_cli.terms.starts import Start, promising
from paramreduce_cli.terms.tape import Remains, Tape

_LOOKED_AT = 200
"""Starts that are looked at to find the smallest one within the budget, at most."""
_FEWEST, _MOST = 12, 60
"""Programs that are gone down from, as many as :data:`_WORK` allows."""
_WORK = 30_000
"""Operations times torques, of all of these: time grows a little faster."""
_IMPROVED = 8
"""Ends of descents from which the search goes on, for half of the rounds."""
_CLOSELY = 2
"""Best ends of these, from which it goes on for all of them, with more samples."""
_SAME = 6
"""Digits of the sums of squared errors, over those allowed, of ends that are taken for the same."""
_LEANEST = 12
"""Programs that are judged, the leanest of all searches."""
_LOOKS = 3
"""Times that parameters and the mass matrices that accelerations are found with take turns."""
_ON_THE_WAY = 16
"""Programs of a front."""


@dataclass(frozen=True)
class Simplified:
    """A program that is left, with its parameters."""

    start: Start
    operations_start: int
    program: Program
    """Its inputs are the parameters of the start, then states."""
    beta: FloatArray

    def refitted(self, samples: TermSamples, budget: Budget) -> Simplified:
        """The same with parameters fitted to more samples."""
        tape = Tape(self.program)
        fitting = Fitting(tape, self.beta.size, samples, budget)
        return replace(self, beta=fitting.fit(tape.everything(), self.beta, looks=_LOOKS).beta)

    def outputs(self, states: FloatArray) -> FloatArray:
        """What it gives, (n_outputs, n_samples), for states (n_states, n_samples)."""
        m = states.shape[1]
        values = np.broadcast_to(self.beta[:, None], (self.beta.size, m))
        given = self.program.evaluated([*values, *states])
        return np.array([np.broadcast_to(value, m) for value in given])

    def compact(self) -> tuple[ReducedModel, Program]:
        """The same with the parameters that the program uses, and no others."""
        model = self.start.model
        used = sorted(
            {
                int(node.number)
                for node in self.program.nodes
                if node.operation == "input" and node.number < model.n
            }
        )
        place = np.full(model.n + 1, NOT_KEPT)
        place[used] = np.arange(len(used))
        dropped = model.n - len(used)
        program = self.program.renumbered(
            lambda position: position - dropped if position >= model.n else int(place[position])
        )
        names = tuple(model.names[k] for k in used)
        return ReducedModel(names, self.beta[used], place[model.position]), program


@dataclass(frozen=True)
class LookedAt:
    """Samples that are looked at while terms are left out."""

    samples: TermSamples
    """What parameters are fitted to."""
    watched: TermSamples | None
    """On which errors must be within the budget as well."""


@dataclass(frozen=True)
class _Passed:
    """A program on the way: less of its fit than would fill the memory."""

    left: Remains
    beta: FloatArray
    cost: float
    excess: float


@dataclass(frozen=True)
class _Way:
    """A search from one program, and what it has come by."""

    start: Start
    operations_start: int
    search: Search
    tape: Tape
    end: Step
    visited: dict[int, _Passed]
    """The best one of every number of operations."""
    stop: threading.Event
    """Set where the search is to end at once."""

    def note(self, step: Step) -> None:
        """Remember a program."""
        if self.stop.is_set():
            raise KeyboardInterrupt
        known = self.visited.get(step.count)
        if known is None or step.fit.excess < known.excess:
            fit = step.fit
            self.visited[step.count] = _Passed(fit.left, fit.beta, fit.cost, fit.excess)

    def simplified(self, passed: _Passed) -> Simplified:
        """A program on the way, its sums and products rearranged."""
        graph = Graph()
        outputs = self.tape.rebuilt(passed.left).rebuilt(graph)
        program = Program.of_graph(*least([Written(graph, outputs)]))
        return Simplified(self.start, self.operations_start, program, passed.beta)


def simplified(
    lean: LeanModels,
    starts: list[Start],
    looked_at: LookedAt,
    closely: LookedAt,
    poses: TermSamples | None,
    budget: Budget,
    *,
    direct: bool,
    rounds: int,
    seed: int,
    jobs: int = 1,
    progress: Callable[[float, str], None] = lambda *_: None,
) -> tuple[list[Simplified], list[Simplified]]:
    """Leave terms out, and let nodes stand for others, as long as errors stay within a budget.

    Starts are gone down from, each in the formulation that is leanest for it; from the best ends terms are put
    back and others left out instead.

    Args:
        lean: Programs of reduced models.
        starts: Subsets, the smallest first; how many are gone down from depends on their operations.
        looked_at: Samples for most of the search.
        closely: More samples, for the best of what was found.
        poses: States at which mass matrices must be positive definite.
        budget: Errors that are allowed.
        direct: Whether [M | delta] is meant, not torques.
        rounds: How often terms are put back.
        seed: Of what is put back.
        jobs: Threads; what is found does not depend on them.
        progress: Told what share is done, and the fewest operations so far.

    Returns:
        Programs, the leanest first, and programs on the way to them, by operations; both are empty
        where no start is within the budget.
    """
    stop = threading.Event()
    ended: list[int] = []

    def begun(start: Start) -> _Way:
        program = (lean.direct if direct else lean.inverse)(start.model)
        n, n_standard, place = start.model.n, lean.n_parameters, start.model.position
        # First the parameters of the model, not all standard ones.
        tape = Tape(
            program.renumbered(lambda k: k - n_standard + n if k >= n_standard else int(place[k]))
        )
        search = searched(start, tape, looked_at)
        return _Way(
            start, program.n_operations, search, tape, search.start(start.model.values), {}, stop
        )

    def searched(start: Start, tape: Tape, some: LookedAt) -> Search:
        fitting = Fitting(tape, start.model.n, some.samples, budget, some.watched, poses)
        return Search(fitting, seed)

    ways = map(begun, starts[:_LOOKED_AT])
    smallest = next((way.start for way in ways if way.end.fit.within), None)
    if smallest is None:
        return [], []
    begins: list[_Way] = []
    for way in map(begun, promising(starts, smallest.model.n)):
        if not way.end.fit.within:
            continue
        begins.append(way)
        if len(begins) >= _affordable(begins, looked_at.samples):
            break
    total = len(begins) + _IMPROVED + 3 * _CLOSELY

    def tell(operations: int) -> None:
        ended.append(operations)
        progress(len(ended) / total, f"{min(ended)} operations")

    def descended(way: _Way) -> _Way:
        way.note(way.end)
        way = replace(way, end=way.search.descended(way.end, way.note))
        tell(way.end.count)
        return way

    def improved(way: _Way, times: int) -> _Way:
        way = replace(way, end=way.search.improved(way.end, times, way.note))
        tell(min(way.visited))
        return way

    def refined(way: _Way) -> _Way:
        closer = replace(way, search=searched(way.start, way.tape, closely), visited={})
        for _, passed in sorted(way.visited.items()):
            end = closer.search.mended(passed.left, passed.beta)
            if end.fit.within:
                closer.note(end)
                return improved(replace(closer, end=end), rounds)
        return closer

    def gone_on(way: _Way) -> _Way:
        """From the leanest program as it is rewritten: it has other terms, and some may go again."""
        if not way.visited:
            return way
        passed = way.visited[min(way.visited)]
        tape = Tape(way.simplified(passed).program)
        search = searched(way.start, tape, closely)
        way = replace(way, search=search, tape=tape, end=search.start(passed.beta), visited={})
        return improved(descended(way), rounds // 2) if way.end.fit.within else way

    # Threads, as nearly all time is spent in compiled code that lets others run.
    with ThreadPoolExecutor(jobs) as pool:
        try:
            ends = _leanest_ends(pool.map(descended, begins), _IMPROVED)
            half = itertools.repeat(rounds // 2)
            better = _leanest_ends(pool.map(improved, ends, half), _CLOSELY)
            close = list(pool.map(refined, better))
            close += list(pool.map(gone_on, close))
        except BaseException:
            stop.set()
            pool.shutdown(wait=True, cancel_futures=True)
            raise
    last = heapq.nsmallest(
        _LEANEST, ((count, k) for k, way in enumerate(close) for count in way.visited)
    )
    found = [close[k].simplified(close[k].visited[count]) for count, k in last]
    found.sort(key=lambda entry: entry.program.n_operations)
    return found, _front(begins + close)


def _affordable(ways: Sequence[_Way], samples: TermSamples) -> int:
    """How many programs such as some are gone down from."""
    work = np.mean([way.operations_start for way in ways]) * samples.tau.shape[0]
    return int(np.clip(_WORK / work, _FEWEST, _MOST))


def _leanest_ends(ways: Iterable[_Way], number: int) -> list[_Way]:
    """The ways to the leanest different ends."""
    ordered = sorted(ways, key=lambda way: (way.end.count, way.end.fit.strain))
    different = {
        (way.end.count, round(way.end.fit.strain, _SAME)): way for way in reversed(ordered)
    }
    return list(different.values())[::-1][:number]


def _front(ways: Sequence[_Way]) -> list[Simplified]:
    """Programs on the way that no leaner one beats, some of them, evenly spread."""
    entries = sorted(
        (count, passed.cost, k)
        for k, way in enumerate(ways)
        for count, passed in way.visited.items()
    )
    kept: list[tuple[int, int]] = []
    least_cost = np.inf
    for count, cost, k in entries:
        if cost < least_cost:
            least_cost = cost
            kept.append((count, k))
    picks = np.unique(np.linspace(0, len(kept) - 1, min(_ON_THE_WAY, len(kept))).astype(int))
    return [ways[k].simplified(ways[k].visited[count]) for count, k in (kept[i] for i in picks)]
