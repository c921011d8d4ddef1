"""The leanest program of one function within a budget of errors, found by leaving terms out."""

from __future__ import annotations

import heapq
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from paramreduce_cli.expressions.factoring import Written, least
from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.expressions.operations import Program
from paramreduce_cli.lean.model import LeanModels
from paramreduce_cli.records import NOT_KEPT, FloatArray, ReducedModel
from paramreduce_cli.terms.fitting import Budget, Fit, Fitting
from paramreduce_cli.terms.samples import TermSamples
from paramreduce_cli.terms.search import Search, Step
from paramreduce_cli.terms.starts import Start
from paramreduce_cli.terms.tape import Tape

_FORMULATIONS = 2
"""Of each start that are gone down from."""
_LEAN, _LOOKED_AT = 3, 60
"""Leanest starts that are gone down from, and how many are looked at to find them."""
_IMPROVED = 3
"""Ends of descents from which the search goes on."""
_LEANEST = 12
"""Programs that are looked at closely, the leanest of each search."""
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
class _Way:
    """A search from one program, and what it has come by."""

    start: Start
    operations_start: int
    search: Search
    tape: Tape
    end: Step
    visited: dict[int, Fit]
    """The best fit of every number of operations."""
    stop: threading.Event
    """Set where the search is to end at once."""

    def note(self, step: Step) -> None:
        """Remember a program."""
        if self.stop.is_set():
            raise KeyboardInterrupt
        known = self.visited.get(step.count)
        if known is None or step.fit.excess < known.excess:
            self.visited[step.count] = step.fit

    def simplified(self, fit: Fit) -> Simplified:
        """A program on the way, its sums and products rearranged."""
        graph = Graph()
        outputs = self.tape.rebuilt(fit.left).rebuilt(graph)
        program = Program.of_graph(*least([Written(graph, outputs)]))
        return Simplified(self.start, self.operations_start, program, fit.beta)


def simplified(
    lean: LeanModels,
    starts: tuple[list[Start], list[Start]],
    samples: TermSamples,
    watched: TermSamples | None,
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

    Every start is gone down from in its leanest formulations; from the best ends terms are put back
    and others left out instead.

    Args:
        lean: Programs of reduced models.
        starts: Where to go down from: the first few that are within the budget, and all of others.
        samples: What parameters are fitted to.
        watched: Samples on which errors must be within the budget as well.
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

    def begun(start: Start, program: Program) -> _Way:
        n, n_standard, place = start.model.n, lean.n_parameters, start.model.position
        # First the parameters of the model, not all standard ones.
        tape = Tape(
            program.renumbered(lambda k: k - n_standard + n if k >= n_standard else int(place[k]))
        )
        search = Search(Fitting(tape, start.model.n, samples, budget, watched, poses), seed)
        return _Way(
            start, program.n_operations, search, tape, search.start(start.model.values), {}, stop
        )

    def several(start: Start) -> list[_Way]:
        programs = lean.several(start.model, _FORMULATIONS, direct=direct)
        return [way for way in (begun(start, p) for p in programs) if way.end.fit.within]

    begins: list[_Way] = []
    for start in starts[0][:_LOOKED_AT]:
        begins += several(start)
        if len(begins) >= _LEAN * _FORMULATIONS:
            break
    known = {way.start.model.names for way in begins}
    begins += [way for s in starts[1] if s.model.names not in known for way in several(s)]
    total = len(begins) + _IMPROVED

    def tell(operations: int) -> None:
        ended.append(operations)
        progress(len(ended) / total, f"{min(ended)} operations")

    def descended(way: _Way) -> _Way:
        way.note(way.end)
        way = replace(way, end=way.search.descended(way.end, way.note))
        tell(way.end.count)
        return way

    def improved(way: _Way) -> None:
        way.search.improved(way.end, rounds, way.note)
        tell(min(way.visited))

    # Threads, as nearly all time is spent in compiled code that lets others run.
    with ThreadPoolExecutor(jobs) as pool:
        try:
            ends = sorted(pool.map(descended, begins), key=lambda way: way.end.count)
            best = ends[:_IMPROVED]
            list(pool.map(improved, best))
        except BaseException:
            stop.set()
            pool.shutdown(wait=True, cancel_futures=True)
            raise
    leanest = heapq.nsmallest(
        _LEANEST, ((count, k) for k, way in enumerate(best) for count in way.visited)
    )
    found = [best[k].simplified(best[k].visited[count]) for count, k in leanest]
    found.sort(key=lambda entry: entry.program.n_operations)
    return found, _front(best)


def _front(ways: list[_Way]) -> list[Simplified]:
    """Programs on the way that no leaner one beats, some of them, evenly spread."""
    entries = sorted(
        (count, fit.cost, k) for k, way in enumerate(ways) for count, fit in way.visited.items()
    )
    kept: list[tuple[int, int]] = []
    least_cost = np.inf
    for count, cost, k in entries:
        if cost < least_cost:
            least_cost = cost
            kept.append((count, k))
    picks = np.unique(np.linspace(0, len(kept) - 1, min(_ON_THE_WAY, len(kept))).astype(int))
    return [ways[k].simplified(ways[k].visited[count]) for count, k in (kept[i] for i in picks)]
