"""Greedy removal of terms, then replacement of nodes by multiples of others or by numbers.

Where no term can go any more, a node may still stand for a multiple of another one, or for a number.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.records import BoolArray, FloatArray, IntArray
from paramreduce_cli.terms.program_fitting import Costs, Fitting, TermFit
from paramreduce_cli.terms.pruning import ITSELF, Pruning

_TRIED = 8
"""Most promising terms that are tried: by the error with parameters fitted again, and without."""
_TRIED_LAST = 20
"""The same where none of these will do: first-order errors are far off for large terms."""
_AT_ONCE = 8
"""Terms that are left out in one step, at most."""
_SUM_HOLDS = 1.2
"""Several terms go together if they cost no more than this times what each costs alone."""
_LITTLE = 0.2
"""Share of what is still allowed that terms may cost which go together without being tried alone."""
_RISE, _LEAST = 3.0, 1e-8
"""The same as a share of the squared error so far, so that programs of all errors are passed on the way, or of the
budget's at least."""
_MISJUDGED = 2.0
"""Times that which they may cost indeed."""
NOISE = 0.3
"""Noise of the logarithm of what terms seem to cost, where something else is to be tried."""


@dataclass(frozen=True)
class Step:
    """A program on the way down, with its number of operations."""

    fit: TermFit
    count: int


class TermSearch:
    """A search that removes terms of one program, and replaces nodes by others.

    Args:
        fitting: Fits the program.
        seed: Seed of the noise.
    """

    def __init__(self, fitting: Fitting, seed: int) -> None:
        self._fitting = fitting
        self.tape = fitting.tape
        self._candidates = self.tape.list_candidates()
        self._droppable: BoolArray = self._candidates[:, 1] != ITSELF
        self._itself = np.zeros(self.tape.size, dtype=np.int64)
        for number, (k, what) in enumerate(self._candidates.tolist()):
            if what == ITSELF:
                self._itself[k] = number
        self._rng = np.random.default_rng(seed)

    def start(self, beta: FloatArray) -> Step:
        """Return the first step, with all terms."""
        return self._step(self._fitting.fit(self.tape.keep_all(), beta, checks=2))

    def descend(
        self,
        step: Step,
        visit: Callable[[Step], None] = lambda _: None,
        noise: float = 0.0,
        until: int = 0,
    ) -> Step:
        """Remove terms and replace nodes until no promising change keeps errors within the budget, or at most ``until``
        operations are left.

        Args:
            step: Step to start from.
            visit: Function that is called with every program on the way.
            noise: Standard deviation of noise on the logarithm of estimated costs.
            until: Number of operations at which to stop.
        """
        weights = np.exp(noise * self._rng.normal(size=len(self._candidates)))
        while step.count > until:
            following = self._remove_cheapest(step, weights, _TRIED) or self._substitute(
                step, weights
            )
            if following is None and noise == 0:
                following = self._remove_cheapest(step, weights, _TRIED_LAST)
            if following is None:
                return step
            step = following
            visit(step)
        return step

    def restore_budget(self, pruning: Pruning, beta: FloatArray) -> Step:
        """Restore the most helpful terms until errors are within the budget; the result exceeds the budget if no term
        helps any more.

        Args:
            pruning: Pruning of the program.
            beta: Parameters to start from.
        """
        fit = self._fitting.fit(pruning, beta, checks=2)
        restored: list[int] = []
        while not fit.within:
            number = self._find_most_helpful(fit, restored)
            if number is None:
                break
            restored.append(number)
            fit = self._fit_flipped(fit, self._candidates[number][None])
        return self._step(fit)

    def _remove_cheapest(self, step: Step, weights: FloatArray, n_checked: int) -> Step | None:
        """Return the program with the cheapest terms removed, or None if all are too costly."""
        fit = step.fit
        numbers, saved = self._find_useful(step)
        if not numbers.size:
            return None
        live, saved = self._candidates[numbers], saved / weights[numbers]
        tried = []
        costs = self._estimate_costs(fit, live)
        several = self._remove_several(step, live, costs.sure, saved)
        if several is not None:
            return several
        lists = [
            np.argsort(cost / saved, kind="stable")[:n_checked]
            for cost in (costs.refitted, costs.unfitted)
        ]
        for number in np.unique(np.concatenate(lists)):
            changed = self._fit_flipped(fit, live[number : number + 1])
            if changed.within:
                tried.append(
                    ((changed.total_cost - fit.total_cost) / saved[number], number, changed)
                )
        if not tried:
            return None
        tried.sort(key=lambda entry: entry[0])
        _, number, best = tried[0]
        chosen = [number]
        for _, number, alone in tried[1:_AT_ONCE]:
            expected = best.total_cost + max(alone.total_cost - fit.total_cost, 0.0) * _SUM_HOLDS
            changed = self._fit_flipped(fit, live[[*chosen, number]])
            if changed.within and changed.total_cost <= expected:
                best, chosen = changed, [*chosen, number]
        return self._step(best)

    def _remove_several(
        self, step: Step, live: IntArray, costs: FloatArray, saved: FloatArray
    ) -> Step | None:
        """Return the program without the terms that together cost little, or without the cheapest of them.

        Return None if fewer than two of them can go within the budget.

        Args:
            step: Step to start from.
            live: Terms that may be removed, (n_terms, 2).
            costs: Cost of removing each term, (n_terms,).
            saved: Number of operations that each removal saves, divided by the noise weight of the term, (n_terms,).
        """
        fit = step.fit
        order = np.argsort(costs / saved, kind="stable")
        expected = np.cumsum(np.maximum(costs[order], 0.0))
        little = min(_LITTLE * (1 - fit.worst_ratio**2), max(_RISE * fit.worst_ratio**2, _LEAST))
        size = int(np.searchsorted(expected, little, side="right"))
        while size > 1:
            changed = self._fit_flipped(fit, live[order[:size]])
            if changed.within and changed.total_cost - fit.total_cost <= _MISJUDGED * little:
                return self._step(changed)
            size //= 2
        return None

    def _substitute(self, step: Step, weights: FloatArray) -> Step | None:
        """Return the program with one node replaced by another, or None if all substitutions are too costly."""
        fit = step.fit
        substitutions, values, pulls = self._fitting.list_substitutions(fit)
        counts = self.tape.count_replaced(
            fit.pruning, substitutions.nodes, substitutions.sources, substitutions.factors
        )
        own = weights[self._itself[substitutions.nodes]]
        useful = np.flatnonzero(counts < step.count)
        substitutions, own, saved = (
            substitutions[useful],
            own[useful],
            (step.count - counts[useful]).astype(float),
        )
        none = np.zeros((len(useful), self._fitting.n))
        costs = fit.linear.estimate_costs(
            substitutions.estimate_changes(values, pulls), fit.beta, none
        )
        lists = [
            np.argsort(cost * own / saved, kind="stable")[:_TRIED]
            for cost in (costs.refitted, costs.unfitted)
        ]
        tried = []
        for place in np.unique(np.concatenate(lists)):
            changed = self._fitting.fit(fit.pruning.replace(*substitutions.get(place)), fit.beta)
            if changed.within:
                tried.append(((changed.total_cost - fit.total_cost) / saved[place], place, changed))
        return self._step(min(tried, key=lambda entry: entry[:2])[2]) if tried else None

    def _find_useful(self, step: Step) -> tuple[IntArray, FloatArray]:
        """Return the indices of the terms whose removal saves operations, and the number of operations each saves."""
        pruning = step.fit.pruning
        # That a node is itself is no term to be left out: see stand-ins.
        numbers = np.flatnonzero(self._droppable & pruning.has(self._candidates))
        saved = step.count - self.tape.count_flipped(pruning, self._candidates[numbers])
        return numbers[saved > 0], saved[saved > 0].astype(float)

    def _step(self, fit: TermFit) -> Step:
        return Step(fit, self.tape.count_operations(fit.pruning))

    def _fit_flipped(self, fit: TermFit, flip: IntArray) -> TermFit:
        """Return the fit with some terms the other way round."""
        return self._fitting.fit(fit.pruning.flip(flip), fit.beta)

    def _estimate_costs(self, fit: TermFit, live: IntArray) -> Costs:
        """Return the costs of removing each term."""
        combinations = self.tape.find_combinations(fit.pruning, live, self._fitting.n)
        return fit.linear.estimate_costs(
            self._fitting.compute_effects(fit, live), fit.beta, combinations
        )

    def _find_most_helpful(self, fit: TermFit, but: list[int]) -> int | None:
        """Return the index of the term whose return lowers the errors most per operation, or None if none does."""
        removed = ~fit.pruning.has(self._candidates)
        removed[but] = False
        numbers = np.flatnonzero(removed)
        if not numbers.size:
            return None
        terms = self._candidates[numbers]
        dearer = self.tape.count_flipped(fit.pruning, terms) - self.tape.count_operations(
            fit.pruning
        )
        G = self._fitting.compute_effects(fit, terms)
        gain = 2 * (G @ fit.linear.residual) - np.einsum("cr,cr->c", G, G)
        gain += fit.linear.compute_explained_squares(G)
        worth = gain / np.maximum(dearer, 0.5)
        return int(numbers[np.argmax(worth)]) if np.any(gain > 0) else None
