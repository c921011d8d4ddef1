"""From one start down: terms are left out, and what is left is rewritten on the way."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from paramreduce_cli.expressions.factoring import Written, least
from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.expressions.operations import Program
from paramreduce_cli.records import NOT_KEPT, FloatArray, ReducedModel
from paramreduce_cli.terms.fitting import Budget, Fitting
from paramreduce_cli.terms.samples import TermSamples
from paramreduce_cli.terms.search import Search, Step
from paramreduce_cli.terms.starts import Start
from paramreduce_cli.terms.tape import Remains, Tape

_LEG = 0.88
"""Share of the operations that are left when a program is rewritten on its way down."""
_MENDED = 4
"""Programs that are made to keep to the budget on other samples, at most."""
_SAME = 6
"""Digits of the sums of squared errors, over those allowed, of ends that are taken for the same."""
_LOOKS = 3
"""Times that parameters and the mass matrices that accelerations are found with take turns."""
_LIKELY = 2.0
"""Operations more than the leanest has, with which a descent is drawn a third as often."""
_ON_THE_WAY = 16
"""Programs of a front."""


@dataclass(frozen=True)
class Simplified:
    """A program that is left, with its parameters."""

    start: Start
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
class Passed:
    """A program on the way: less of its fit than would fill the memory."""

    tape: Tape
    """The program that it is what is left of."""
    left: Remains
    beta: FloatArray
    cost: float
    excess: float


@dataclass(frozen=True)
class Descent:
    """A search from one start, and what it has come by."""

    start: Start
    searching: Callable[[Tape], Search]
    """Makes the search among the terms of a program of this start."""
    stop: threading.Event
    """Set where it is to end at once."""
    search: Search
    """Among the terms of the program as it was last rewritten."""
    end: Step
    """Of that program."""
    visited: dict[int, Passed]
    """The best one of every number of operations."""

    @classmethod
    def begun(
        cls, start: Start, tape: Tape, searching: Callable[[Tape], Search], stop: threading.Event
    ) -> Descent:
        """With all terms of a program, whose first inputs are the parameters of the start."""
        search = searching(tape)
        descent = cls(start, searching, stop, search, search.start(start.model.values), {})
        descent._note(descent.end)
        return descent

    @property
    def fewest(self) -> int:
        """Operations of the leanest program that it has come by."""
        return min(self.visited)

    @property
    def rank(self) -> tuple[int, float]:
        """The less the better; the same for ends that are the same."""
        return self.fewest, round(self.end.fit.strain, _SAME)

    def down(self, noise: float = 0.0) -> Descent:
        """Leave terms out until no more can go, also of what comes of rewriting.

        A rewritten program has other terms than before, and shares more of what they are made of. It
        is rewritten early, too: which terms are cheap to do without hangs on what the others share.

        Args:
            noise: Of the logarithm of what terms seem to cost, until no more can go with it.
        """
        descent = self
        while True:
            before = descent.fewest
            until = int(_LEG * descent.end.count)
            end = descent.search.descended(descent.end, descent._note, noise, until=until)
            descent = replace(descent, end=end)
            rewritten = descent._rewritten()
            if rewritten.fewest == before:
                return descent.down() if noise else descent
            descent = rewritten

    def on(self, searching: Callable[[Tape], Search]) -> Descent | None:
        """Down on other samples, from the leanest program within the budget there, or made to be.

        None where there is none.
        """
        tried: list[Descent] = []
        for count, passed in sorted(self.visited.items()):
            search = searching(passed.tape)
            end = search.mended(passed.left, passed.beta)
            if not end.fit.within:
                continue
            descent = Descent(self.start, searching, self.stop, search, end, {})
            descent._note(end)
            tried.append(descent.down())
            if end.count <= count or len(tried) == _MENDED:
                break
        return min(tried, key=lambda one: one.rank, default=None)

    def _rewritten(self) -> Descent:
        """Among the terms of the leanest program as it is rewritten; as it was if that takes it out of the budget.

        Mass matrices are taken anew, which is enough for what is at the edge of it.
        """
        passed = self.visited[self.fewest]
        search = self.searching(Tape(self.simplified(passed).program))
        end = search.start(passed.beta)
        if not end.fit.within:
            return self
        descent = replace(self, search=search, end=end)
        descent._note(end)
        return descent

    def _note(self, step: Step) -> None:
        """Remember a program."""
        if self.stop.is_set():
            raise KeyboardInterrupt
        known = self.visited.get(step.count)
        if known is None or step.fit.excess < known.excess:
            fit = step.fit
            passed = Passed(self.search.tape, fit.left, fit.beta, fit.cost, fit.excess)
            self.visited[step.count] = passed

    def simplified(self, passed: Passed) -> Simplified:
        """A program on the way, its sums and products rearranged."""
        graph = Graph()
        outputs = passed.tape.rebuilt(passed.left).rebuilt(graph)
        return Simplified(
            self.start, Program.of_graph(*least([Written(graph, outputs)])), passed.beta
        )


def leanest(descents: Iterable[Descent], number: int) -> list[Descent]:
    """Those with the leanest different ends, so many at most."""
    different = {descent.rank: descent for descent in descents}
    return [different[rank] for rank in sorted(different)[:number]]


def drawn(descents: Sequence[Descent], rng: np.random.Generator) -> Descent:
    """One of them at random, the likelier the leaner."""
    fewest = np.array([one.fewest for one in descents])
    weights = np.exp((fewest.min() - fewest) / _LIKELY)
    return descents[int(rng.choice(len(descents), p=weights / weights.sum()))]


def front(descents: Iterable[Descent]) -> list[Simplified]:
    """Programs on the way that no leaner one beats, some of them, evenly spread."""
    entries = [
        (count, passed.cost, descent)
        for descent in descents
        for count, passed in descent.visited.items()
    ]
    kept: list[tuple[int, Descent]] = []
    least_cost = np.inf
    for count, cost, descent in sorted(entries, key=lambda entry: entry[:2]):
        if cost < least_cost:
            least_cost = cost
            kept.append((count, descent))
    picks = np.unique(np.linspace(0, len(kept) - 1, min(_ON_THE_WAY, len(kept))).astype(int))
    return [
        descent.simplified(descent.visited[count]) for count, descent in (kept[i] for i in picks)
    ]
