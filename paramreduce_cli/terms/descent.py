"""From one start down: terms are left out, and what is left is rewritten on the way."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from paramreduce_cli.expressions.factoring import Written, least
from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.expressions.operations import Program
from paramreduce_cli.expressions.scaling import rescaled
from paramreduce_cli.records import NOT_KEPT, FloatArray, ReducedModel
from paramreduce_cli.terms.fitting import Budget, Fitting
from paramreduce_cli.terms.pruning import Pruning
from paramreduce_cli.terms.samples import TermSamples
from paramreduce_cli.terms.search import Step, TermSearch
from paramreduce_cli.terms.starts import Start
from paramreduce_cli.terms.tape import Outputs, Tape

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
_DICE = 2**40
"""Ways for the dice of rewriting to fall."""
_EXACT = 1e-18
"""Squared share of the budget below which errors are no more than rounding."""


@dataclass(frozen=True)
class Simplified:
    """A program that is left, with its parameters."""

    start: Start
    program: Program
    """Its inputs are the parameters of the start, then states."""
    beta: FloatArray
    units: FloatArray
    """Sizes of the units of its parameters, SI, (n,)."""

    def refitted(self, samples: TermSamples, budget: Budget) -> Simplified:
        """The same with parameters fitted to more samples."""
        tape = Tape(self.program)
        fitting = Fitting(tape, self.beta.size, samples, budget)
        return replace(self, beta=fitting.fit(tape.everything(), self.beta, looks=_LOOKS).beta)

    def outputs(self, states: FloatArray) -> Outputs:
        """What it gives for states (n_states, n_samples)."""
        m = states.shape[1]
        values = np.broadcast_to(self.beta[:, None], (self.beta.size, m))
        given = self.program.evaluated([*values, *states])
        return Outputs.of(np.array([np.broadcast_to(value, m) for value in given]))

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
        values, units = self.beta[used], self.units[used]
        return ReducedModel(names, values, place[model.position], units=units), program


@dataclass(frozen=True)
class Passed:
    """A program on the way: less of its fit than would fill the memory."""

    tape: Tape
    """The program that it is what is left of."""
    pruning: Pruning
    beta: FloatArray
    units: FloatArray
    """Sizes of the units of its parameters, SI, (n,)."""
    cost: float
    excess: float


@dataclass(frozen=True)
class Way:
    """What a descent has come by."""

    start: Start
    visited: dict[int, Passed]
    """The best program of every number of operations."""
    fewest: int
    """Operations of the leanest program, which may not be remembered any more."""
    strain: float
    """Of the end."""

    @property
    def rank(self) -> tuple[int, float]:
        """The less the better; the same for ends that are the same."""
        return self.fewest, round(self.strain, _SAME)

    def simplified(self, passed: Passed, dice: int = 0) -> Simplified:
        """A program on the way, its sums and products rearranged; how hangs on the dice."""
        program, sizes = rescaled(passed.tape.rebuilt(passed.pruning), passed.beta.size)
        graph = Graph()
        program = Program.of_graph(*least([Written(graph, program.rebuilt(graph))], dice))
        return Simplified(self.start, program, passed.beta / sizes, passed.units * sizes)


@dataclass(frozen=True)
class Descent:
    """A search from one start, and what it has come by."""

    start: Start
    searching: Callable[[Tape], TermSearch]
    """Makes the search among the terms of a program of this start."""
    search: TermSearch
    """Among the terms of the program as it was last rewritten."""
    end: Step
    """Of that program."""
    units: FloatArray
    """Sizes of the units of its parameters, SI, (n,)."""
    visited: dict[int, Passed]
    """The best one of every number of operations."""

    @classmethod
    def begun(
        cls, start: Start, program: Program, searching: Callable[[Tape], TermSearch]
    ) -> Descent:
        """With all terms of a program, whose first inputs are the parameters of the start."""
        program, units = rescaled(program, start.model.n)
        return cls._of(Simplified(start, program, start.model.values / units, units), searching, {})

    @classmethod
    def again(
        cls, way: Way, rng: np.random.Generator, searching: Callable[[Tape], TermSearch]
    ) -> Descent:
        """From a program shortly before the end of a descent, written in another way.

        Where sums and products were rearranged by other dice, it has other terms to leave out. What the descent passed
        before stays with it, as on other samples a dearer program may be the one to go on from.

        Args:
            way: What the descent has come by.
            rng: Which program it is, and the dice.
            searching: Makes searches.
        """
        near = [count for count in sorted(way.visited) if count <= way.fewest / _LEG]
        count = int(rng.choice(near))
        dearer = {known: passed for known, passed in way.visited.items() if known > count}
        whole = way.simplified(way.visited[count], int(rng.integers(_DICE)))
        return cls._of(whole, searching, dearer)

    @classmethod
    def _of(
        cls, whole: Simplified, searching: Callable[[Tape], TermSearch], visited: dict[int, Passed]
    ) -> Descent:
        """With all terms of a program, after others on the way to it."""
        search = searching(Tape(whole.program))
        end = search.start(whole.beta)
        descent = cls(whole.start, searching, search, end, whole.units, visited)
        descent._note(end)
        return descent

    @property
    def way(self) -> Way:
        """What it has come by so far."""
        return Way(self.start, self.visited, min(self.visited), self.end.fit.strain)

    def down(self, noise: float = 0.0) -> Way:
        """Leave terms out until no more can go, also of what comes of rewriting.

        A rewritten program has other terms than before, and shares more of what they are made of. It
        is rewritten early, too: which terms are cheap to do without hangs on what the others share.

        Args:
            noise: Of the logarithm of what terms seem to cost, until no more can go with it.
        """
        descent = self
        while True:
            before = min(descent.visited)
            until = int(_LEG * descent.end.count)
            end = descent.search.descended(descent.end, descent._note, noise, until=until)
            descent = replace(descent, end=end)
            rewritten = descent._rewritten()
            if min(rewritten.visited) == before:
                return descent.down() if noise else descent.way
            descent = rewritten

    def _rewritten(self) -> Descent:
        """Among the terms of the leanest program as it is rewritten; as it was if that takes it out of the budget.

        Mass matrices are taken anew, which is enough for what is at the edge of it.
        """
        passed = self.visited[min(self.visited)]
        simplified = self.way.simplified(passed)
        search = self.searching(Tape(simplified.program))
        end = search.start(simplified.beta)
        if not end.fit.within:
            return self
        descent = replace(self, search=search, end=end, units=simplified.units)
        descent._note(end)
        return descent

    def _note(self, step: Step) -> None:
        """Remember a program."""
        known = self.visited.get(step.count)
        if known is None or step.fit.excess < known.excess:
            fit = step.fit
            passed = Passed(
                self.search.tape, fit.pruning, fit.beta, self.units, fit.cost, fit.excess
            )
            self.visited[step.count] = passed


def gone_on(way: Way, searching: Callable[[Tape], TermSearch]) -> Way | None:
    """Down on other samples, from the leanest program within the budget there, or made to be.

    Args:
        way: Of a descent on some samples.
        searching: Makes searches on others.

    Returns:
        None where no program is within the budget there.
    """
    tried: list[Way] = []
    for count, passed in sorted(way.visited.items()):
        search = searching(passed.tape)
        end = search.mended(passed.pruning, passed.beta)
        if not end.fit.within:
            continue
        descent = Descent(way.start, searching, search, end, passed.units, {})
        descent._note(end)
        tried.append(descent.down())
        if end.count <= count or len(tried) == _MENDED:
            break
    return min(tried, key=lambda one: one.rank, default=None)


def leanest(ways: Iterable[Way], number: int) -> list[Way]:
    """Those with the leanest different ends, so many at most."""
    different: dict[tuple[int, float], Way] = {}
    for way in ways:
        different.setdefault(way.rank, way)
    return [different[rank] for rank in sorted(different)[:number]]


def drawn(ways: Sequence[Way], rng: np.random.Generator) -> Way:
    """One of them at random, the likelier the leaner."""
    fewest = np.array([one.fewest for one in ways])
    weights = np.exp((fewest.min() - fewest) / _LIKELY)
    return ways[int(rng.choice(len(ways), p=weights / weights.sum()))]


def slimmed(ways: Sequence[Way], number: int) -> list[Way]:
    """The same ways, of all but the leanest ones only programs that are the best of their operations.

    Hundreds of ways with all that they have passed would fill the memory.

    Args:
        ways: In any order, which is kept.
        number: How many of the leanest stay whole.
    """
    whole = {id(way) for way in leanest(ways, number)}
    costs: dict[int, float] = {}
    for way in ways:
        for count, passed in way.visited.items():
            costs[count] = min(passed.cost, costs.get(count, np.inf))

    def best(way: Way) -> Way:
        some = {count: one for count, one in way.visited.items() if one.cost <= costs[count]}
        return replace(way, visited=some)

    return [way if id(way) in whole else best(way) for way in ways]


def front(ways: Iterable[Way]) -> list[Simplified]:
    """Programs on the way that no leaner one beats, some of them, evenly spread."""
    entries = [
        (count, max(passed.cost, _EXACT), way)
        for way in ways
        for count, passed in way.visited.items()
    ]
    kept: list[tuple[int, Way]] = []
    least_cost = np.inf
    for count, cost, way in sorted(entries, key=lambda entry: entry[:2]):
        if cost < least_cost:
            least_cost = cost
            kept.append((count, way))
    picks = np.unique(np.linspace(0, len(kept) - 1, min(_ON_THE_WAY, len(kept))).astype(int))
    return [way.simplified(way.visited[count]) for count, way in (kept[i] for i in picks)]
