"""The leanest program of one function within a budget of errors, found by leaving terms out."""

from __future__ import annotations

import heapq
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from paramreduce_cli.lean.model import LeanModels
from paramreduce_cli.terms.descent import Descent, Simplified, drawn, front, leanest
from paramreduce_cli.terms.fitting import Budget, Fitting
from paramreduce_cli.terms.samples import TermSamples
from paramreduce_cli.terms.search import NOISE, Search
from paramreduce_cli.terms.starts import Start, near, promising
from paramreduce_cli.terms.tape import Tape

_LOOKED_AT = 200
"""Starts that are looked at to find the smallest one within the budget, at most."""
_FEWEST, _MOST = 12, 30
"""Programs that are gone down from, as many as :data:`_WORK` allows."""
_WORK = 40_000
"""Operations times torques, of all of these: time grows a little faster."""
_BEST = 4
"""Starts with the leanest ends, near which others are gone down from."""
_DRAWN = 0.25
"""How often this is done near one of all, so that what is no better at once is gone on from too."""
_AT_ONCE = 8
"""Of these others, before the best are looked for again."""
_NOISY = 0.5
"""How often there is noise in the choice of terms then."""
_CLOSELY = 8
"""Leanest ends of all descents, gone on from with more samples."""
_LEANEST = 12
"""Programs that are judged, the leanest of all searches."""


@dataclass(frozen=True)
class LookedAt:
    """Samples that are looked at while terms are left out."""

    samples: TermSamples
    """What parameters are fitted to."""
    watched: TermSamples | None
    """On which errors must be within the budget as well."""


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

    Starts are gone down from, each in the formulation that is leanest for it, then others near the best ones, whose
    formulations are changed at random; from the best ends it goes on with more samples.

    Args:
        lean: Programs of reduced models.
        starts: Subsets, the smallest first; how many are gone down from depends on their operations.
        looked_at: Samples for most of the search.
        closely: More samples, for the best of what was found.
        poses: States at which mass matrices must be positive definite.
        budget: Errors that are allowed.
        direct: Whether [M | delta] is meant, not torques.
        rounds: How many starts near the best ones are gone down from.
        seed: Of what is random.
        jobs: Threads; what is found does not depend on them.
        progress: Told what share is done, and the fewest operations so far.

    Returns:
        Programs, the leanest first, and programs on the way to them, by operations; both are empty
        where no start is within the budget.
    """
    stop = threading.Event()
    ended: list[int] = []

    def searching(start: Start, some: LookedAt, turn: int = 0) -> Callable[[Tape], Search]:
        def made(tape: Tape) -> Search:
            fitting = Fitting(tape, start.model.n, some.samples, budget, some.watched, poses)
            return Search(fitting, seed + turn)

        return made

    def begun(start: Start, turn: int = 0) -> Descent:
        tape = Tape(start.program(lean, direct=direct))
        return Descent.begun(start, tape, searching(start, looked_at, turn), stop)

    every = map(begun, starts[:_LOOKED_AT])
    smallest = next((one.start for one in every if one.end.fit.within), None)
    if smallest is None:
        return [], []
    begins: list[Descent] = []
    for one in map(begun, promising(starts, smallest.model.n)):
        if not one.end.fit.within:
            continue
        begins.append(one)
        if len(begins) >= _affordable(begins, looked_at.samples):
            break
    total = len(begins) + rounds + _CLOSELY

    def told(descent: Descent) -> Descent:
        ended.append(descent.fewest)
        progress(len(ended) / total, f"{min(ended)} operations")
        return descent

    def down(descent: Descent) -> Descent:
        return told(descent.down())

    def nearby(ends: list[Descent], turn: int) -> Descent | None:
        rng = np.random.default_rng([seed, turn])
        best = leanest(ends, _BEST)
        parent = best[turn % len(best)] if rng.random() > _DRAWN else drawn(ends, rng)
        others = [one.start for one in best]
        one = begun(near(parent.start, others, lean, rng, direct=direct), turn)
        # The functions are the same, but at the edge of the budget rounding may tell.
        return told(one.down(NOISE * (rng.random() < _NOISY))) if one.end.fit.within else None

    def refined(descent: Descent) -> Descent | None:
        closer = descent.on(searching(descent.start, closely))
        return None if closer is None else told(closer)

    # Threads, as nearly all time is spent in compiled code that lets others run.
    with ThreadPoolExecutor(jobs) as pool:
        try:
            ends = list(pool.map(down, begins))
            for first in range(0, rounds, _AT_ONCE):
                turns = range(first, min(first + _AT_ONCE, rounds))
                ends += [one for one in pool.map(partial(nearby, ends), turns) if one is not None]
            close = [one for one in pool.map(refined, leanest(ends, _CLOSELY)) if one is not None]
        except BaseException:
            stop.set()
            pool.shutdown(wait=True, cancel_futures=True)
            raise
    last = heapq.nsmallest(
        _LEANEST, ((count, k) for k, one in enumerate(close) for count in one.visited)
    )
    found = [close[k].simplified(close[k].visited[count]) for count, k in last]
    found.sort(key=lambda one: one.program.n_operations)
    return found, front(ends + close)


def _affordable(descents: Sequence[Descent], samples: TermSamples) -> int:
    """How many programs such as some are gone down from."""
    work = np.mean([max(one.visited) for one in descents]) * samples.tau.shape[0]
    return int(np.clip(_WORK / work, _FEWEST, _MOST))
