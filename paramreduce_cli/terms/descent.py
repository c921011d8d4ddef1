"""A descent from one start: terms are pruned, and the remaining program is rewritten on the way."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from paramreduce_cli.expressions.factoring import Values, minimise_operations
from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.expressions.programs import Program
from paramreduce_cli.expressions.scaling import rescale
from paramreduce_cli.records import NOT_KEPT, FloatArray, ReducedModel
from paramreduce_cli.terms.fit_samples import TermSamples
from paramreduce_cli.terms.program_fitting import Budget, Fitting
from paramreduce_cli.terms.pruning import Pruning
from paramreduce_cli.terms.starts import Start
from paramreduce_cli.terms.tape import Outputs, Tape
from paramreduce_cli.terms.term_removal import Step, TermSearch

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
_LARGEST_SEED = 2**40
"""Ways for the dice of rewriting to fall."""
_EXACT = 1e-18
"""Squared share of the budget below which errors are no more than rounding."""


@dataclass(frozen=True)
class Simplified:
    """A program that is left, with its parameters."""

    start: Start
    program: Program
    """Program whose inputs are the parameters of the start, then states."""
    beta: FloatArray
    units: FloatArray
    """Sizes of the units of its parameters, SI, (n,)."""

    def refit(self, samples: TermSamples, budget: Budget) -> Simplified:
        """Return the program with its parameters fitted to more samples."""
        tape = Tape(self.program)
        fitting = Fitting(tape, self.beta.size, samples, budget)
        return replace(self, beta=fitting.fit(tape.keep_all(), self.beta, checks=_LOOKS).beta)

    def evaluate(self, states: FloatArray) -> Outputs:
        """Return the outputs of the program for states, (n_states, n_samples)."""
        m = states.shape[1]
        values = np.broadcast_to(self.beta[:, None], (self.beta.size, m))
        given = self.program.evaluate([*values, *states])
        return Outputs.drop_zero(np.array([np.broadcast_to(value, m) for value in given]))

    def drop_unused(self) -> tuple[ReducedModel, Program]:
        """Return the model and the program without the parameters that the program does not use."""
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
        program = self.program.renumber(
            lambda position: position - dropped if position >= model.n else int(place[position])
        )
        names = tuple(model.names[k] for k in used)
        values, units = self.beta[used], self.units[used]
        return ReducedModel(names, values, place[model.position], units=units), program


@dataclass(frozen=True)
class Candidate:
    """A candidate that a search has reached: a program before pruning, its pruning, and its parameters."""

    tape: Tape
    """The program that it is what is left of."""
    pruning: Pruning
    beta: FloatArray
    units: FloatArray
    """Sizes of the units of its parameters, SI, (n,)."""
    cost: float
    worst_ratio: float


@dataclass(frozen=True)
class SearchHistory:
    """The history of a descent: its start, and the candidates on the way down."""

    start: Start
    visited: dict[int, Candidate]
    """The best program of every number of operations."""
    fewest: int
    """Operations of the leanest program, which may not be remembered any more."""
    total_cost: float
    """Cost at the end of the descent, including errors on watched samples."""

    @property
    def rank(self) -> tuple[int, float]:
        """Fewest operations, then worst ratio to the budget; less is better, and equal ends have equal ranks."""
        return self.fewest, round(self.total_cost, _SAME)

    def rebuild(self, passed: Candidate, seed: int = 0) -> Simplified:
        """Return the program of a candidate, with its sums and products rearranged as a seed says."""
        program, sizes = rescale(passed.tape.rebuild(passed.pruning), passed.beta.size)
        graph = Graph()
        program = Program.from_graph(
            *minimise_operations([Values(graph, program.rebuild(graph))], seed)
        )
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
    """Step of that program."""
    units: FloatArray
    """Sizes of the units of its parameters, SI, (n,)."""
    visited: dict[int, Candidate]
    """The best one of every number of operations."""

    @classmethod
    def start_from(
        cls, start: Start, program: Program, searching: Callable[[Tape], TermSearch]
    ) -> Descent:
        """Return a descent with all terms of a program, whose first inputs are the parameters of the start."""
        program, units = rescale(program, start.model.n)
        return cls._make(
            Simplified(start, program, start.model.values / units, units), searching, {}
        )

    @classmethod
    def restart(
        cls,
        history: SearchHistory,
        rng: np.random.Generator,
        searching: Callable[[Tape], TermSearch],
    ) -> Descent:
        """Return a descent from a program shortly before the end of another descent, written in another way.

        With its sums and products rearranged, the program has other terms to remove. Candidates of the other descent
        are kept, because on other samples a program with more operations may be the better one to continue from.

        Args:
            history: History of the descent.
            rng: Random generator for the choice of the program, and for rewriting.
            searching: Function that makes the term search of a program.
        """
        near = [count for count in sorted(history.visited) if count <= history.fewest / _LEG]
        count = int(rng.choice(near))
        dearer = {known: passed for known, passed in history.visited.items() if known > count}
        whole = history.rebuild(history.visited[count], int(rng.integers(_LARGEST_SEED)))
        return cls._make(whole, searching, dearer)

    @classmethod
    def _make(
        cls,
        whole: Simplified,
        searching: Callable[[Tape], TermSearch],
        visited: dict[int, Candidate],
    ) -> Descent:
        """Return a descent with all terms of a program, after earlier candidates."""
        search = searching(Tape(whole.program))
        end = search.start(whole.beta)
        descent = cls(whole.start, searching, search, end, whole.units, visited)
        descent._note(end)
        return descent

    @property
    def history(self) -> SearchHistory:
        """Return the history so far."""
        return SearchHistory(self.start, self.visited, min(self.visited), self.end.fit.total_cost)

    def descend(self, noise: float = 0.0) -> SearchHistory:
        """Remove terms until none can go, also terms that appear by rewriting.

        A rewritten program has other terms, and shares more subexpressions. The program is rewritten early, too,
        because which terms are cheap to remove depends on what the others share.

        Args:
            noise: Standard deviation of noise on the logarithm of estimated costs, until no more can go with it.
        """
        descent = self
        while True:
            before = min(descent.visited)
            until = int(_LEG * descent.end.count)
            end = descent.search.descend(descent.end, descent._note, noise, until=until)
            descent = replace(descent, end=end)
            rewritten = descent._rewrite()
            if min(rewritten.visited) == before:
                return descent.descend() if noise else descent.history
            descent = rewritten

    def _rewrite(self) -> Descent:
        """Return a descent from the leanest program so far after rewriting, or this descent if the rewritten program
        exceeds the budget of errors.
        """
        passed = self.visited[min(self.visited)]
        simplified = self.history.rebuild(passed)
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
        if known is None or step.fit.worst_ratio < known.worst_ratio:
            fit = step.fit
            passed = Candidate(
                self.search.tape, fit.pruning, fit.beta, self.units, fit.cost, fit.worst_ratio
            )
            self.visited[step.count] = passed


def continue_on_samples(
    history: SearchHistory, searching: Callable[[Tape], TermSearch]
) -> SearchHistory | None:
    """Continue a descent on other samples, from the leanest program that is within the budget there.

    Args:
        history: History of a descent on some samples.
        searching: Function that makes the term search of a program on the other samples.

    Returns:
        None where no program is within the budget there.
    """
    tried: list[SearchHistory] = []
    for count, passed in sorted(history.visited.items()):
        search = searching(passed.tape)
        end = search.restore_budget(passed.pruning, passed.beta)
        if not end.fit.within:
            continue
        descent = Descent(history.start, searching, search, end, passed.units, {})
        descent._note(end)
        tried.append(descent.descend())
        if end.count <= count or len(tried) == _MENDED:
            break
    return min(tried, key=lambda one: one.rank, default=None)


def find_leanest_histories(histories: Iterable[SearchHistory], number: int) -> list[SearchHistory]:
    """Return at most ``number`` histories, those with the fewest operations at their ends, one of each different end."""
    different: dict[tuple[int, float], SearchHistory] = {}
    for history in histories:
        different.setdefault(history.rank, history)
    return [different[rank] for rank in sorted(different)[:number]]


def draw_history(histories: Sequence[SearchHistory], rng: np.random.Generator) -> SearchHistory:
    """Return a random history; leaner ends are likelier."""
    fewest = np.array([one.fewest for one in histories])
    weights = np.exp((fewest.min() - fewest) / _LIKELY)
    return histories[int(rng.choice(len(histories), p=weights / weights.sum()))]


def drop_candidates(histories: Sequence[SearchHistory], number: int) -> list[SearchHistory]:
    """Return the histories, of which all but the leanest keep only the best candidate for each number of operations.

    Hundreds of whole histories would fill the memory.

    Args:
        histories: Histories in any order, which is kept.
        number: Number of the leanest histories that stay complete.
    """
    whole = {id(entry) for entry in find_leanest_histories(histories, number)}
    costs: dict[int, float] = {}
    for entry in histories:
        for count, passed in entry.visited.items():
            costs[count] = min(passed.cost, costs.get(count, np.inf))

    def keep_best(history: SearchHistory) -> SearchHistory:
        """Return a history with only the candidates that no other history beats."""
        some = {count: one for count, one in history.visited.items() if one.cost <= costs[count]}
        return replace(history, visited=some)

    return [entry if id(entry) in whole else keep_best(entry) for entry in histories]


def list_front(histories: Iterable[SearchHistory]) -> list[Simplified]:
    """Return programs of histories that no leaner program beats, a few of them, evenly spread."""
    entries = [
        (count, max(passed.cost, _EXACT), history)
        for history in histories
        for count, passed in history.visited.items()
    ]
    kept: list[tuple[int, SearchHistory]] = []
    least_cost = np.inf
    for count, cost, history in sorted(entries, key=lambda entry: entry[:2]):
        if cost < least_cost:
            least_cost = cost
            kept.append((count, history))
    picks = np.unique(np.linspace(0, len(kept) - 1, min(_ON_THE_WAY, len(kept))).astype(int))
    return [history.rebuild(history.visited[count]) for count, history in (kept[i] for i in picks)]
