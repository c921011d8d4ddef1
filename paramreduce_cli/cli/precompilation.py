"""The compiled loops of all searches, made before the first run needs them.

A loop is compiled when it is first called, and kept for all runs. Here small examples call every loop.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from paramreduce_cli.resources.processes import start_workers

_EXAMPLE = "two_link"
_QUICK = (
    "trajectories.count=1",
    "trajectories.starts=1",
    "trajectories.max_iterations=2",
    "reduction.heuristics=[forward-selection]",
    "terms={torque_error: 0.5, acceleration_error: 5, rounds: 1}",
)


def compile_loops() -> None:
    """Compile the loops of all searches in two processes, each about a quarter of a minute the first time.

    Raises:
        DataError: A process died.
    """
    with start_workers(2, _search_examples) as pool:
        for _ in pool.map_unordered(_compile, ["proofs", "terms"]):
            pass


def _search_examples() -> dict[str, Callable[[], None]]:
    return {"proofs": _prove_best_subsets, "terms": _prune_terms}


def _compile(examples: dict[str, Callable[[], None]], name: str) -> None:
    examples[name]()


def _prove_best_subsets() -> None:
    """Prove the best subset of a few columns, some of which depend on others."""
    from paramreduce_cli.reduction.best_subset.subset_search import (
        BEGINNING,
        Search,
        normalise_problem,
    )
    from paramreduce_cli.reduction.problem import SelectionProblem

    rng = np.random.default_rng(0)
    W = rng.normal(size=(9, 4)) @ rng.normal(size=(4, 6))
    columns = np.arange(6)
    problem = SelectionProblem(W, W @ rng.normal(size=6), columns, columns, ())
    Search(normalise_problem(problem), 3, 1.0, BEGINNING).advance(10)


def _prune_terms() -> None:
    """Run the small arm as far as its functions without terms; their operations are counted on the way."""
    from paramreduce_cli.config import load_config
    from paramreduce_cli.config.examples import list_examples
    from paramreduce_cli.records import Run, TermReduction
    from paramreduce_cli.running.in_memory import run_in_memory
    from paramreduce_cli.running.pipeline import list_stages_to_run

    config = load_config(list_examples()[_EXAMPLE], _QUICK)
    records: dict[type, Any] = {}
    for stage in list_stages_to_run(config):
        records[stage.output] = run_in_memory(stage, config, records, Run())
        if stage.output is TermReduction:
            return
