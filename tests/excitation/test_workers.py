from functools import partial

import numpy as np
import pytest
from conftest import config_and_model

from paramreduce_cli.records import Items, Run
from paramreduce_cli.stages.optimize_trajectories import optimize_trajectories


@pytest.fixture(scope="module")
def optimise():
    config, model = config_and_model("two_link", "trajectories.starts=2")
    return partial(_optimise, config.trajectories, model)


def _optimise(section, model, run, items=None):
    return optimize_trajectories(section, model, None, run, items or Items())


def test_results_do_not_depend_on_the_number_of_processes(optimise):
    one, two = (optimise(Run(jobs)) for jobs in (1, 2))
    for a, b in zip(
        one.estimation + one.validation + one.test,
        two.estimation + two.validation + two.test,
        strict=True,
    ):
        assert np.array_equal(a.coefficients, b.coefficients)


def test_finished_items_are_not_made_again(optimise):
    seen = []
    items = Items()
    made = optimise(Run(2), items)
    del items.kept["estimation-0001"]
    kept = items.kept["estimation-0000"]
    again = optimise(Run(2, progress=lambda p: seen.append((p.task, p.detail))), items)
    assert again.estimation[0] is kept
    assert np.array_equal(again.estimation[1].coefficients, made.estimation[1].coefficients)
    others = len(made.estimation) + len(made.validation) + len(made.test) - 1
    assert ("trajectories", f"{others} kept from before") in seen


def test_trajectories_differ_and_are_better_than_their_starts(optimise):
    made = optimise(Run(2))
    assert not np.allclose(made.estimation[0].coefficients, made.estimation[1].coefficients)
    assert not np.allclose(made.estimation[0].coefficients, made.validation[0].coefficients)
    for t in made.estimation:
        assert t.kappa < t.kappa_start
        assert t.cpu_seconds > 0
        assert t.iterations > 0
        assert (t.reach > 0.9).all()
        assert (t.reach <= 1).all()
