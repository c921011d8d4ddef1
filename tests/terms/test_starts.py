"""Which subsets are gone down from, and in which formulations."""

from types import SimpleNamespace

import numpy as np
import pytest
from conftest import model_of

from paramreduce_cli.lean.lean_models import LeanModels
from paramreduce_cli.reduction.models import make_base_model
from paramreduce_cli.terms.starts import Start, order_by_estimate, vary_start


def start(n, cost, error):
    return Start("swap", SimpleNamespace(n=n), error, cost)


def test_the_leanest_of_every_size_come_first_and_of_far_sizes_the_most_exact_one_too():
    starts = [
        start(10, 100, 0.009), start(10, 120, 0.008), start(11, 110, 0.007), start(18, 200, 0.005),
        start(19, 210, 0.005), start(22, 230, 0.004), start(22, 240, 0.002), start(22, 250, 0.003),
        start(9, 300, 0.009),
    ]  # fmt: skip
    order = [(one.model.n, one.cost) for one in order_by_estimate(starts, 10)]
    assert order == [(10, 100), (11, 110), (18, 200), (22, 230), (10, 120), (22, 240)]


def test_a_subset_that_is_both_the_leanest_and_the_most_exact_is_one_start():
    starts = [start(10, 100, 0.009), start(22, 230, 0.001), start(22, 240, 0.002)]
    assert [one.cost for one in order_by_estimate(starts, 10)] == [100, 230]


@pytest.mark.parametrize("direct", [False, True])
def test_starts_near_one_are_the_same_function_written_otherwise(direct):
    model = model_of("puma560")
    lean, base = LeanModels(model), make_base_model(model)
    one = Start("base", base, 0.0, 0)
    states = np.random.default_rng(0).normal(size=(18, 20))
    inputs = [*np.broadcast_to(base.values[:, None], (base.n, 20)), *states]

    def outputs(some):
        return np.array(some.build_program(lean, direct=direct).evaluate(inputs))

    expected, formulations, at = outputs(one), [], one
    for seed in range(8):
        at = vary_start(at, [one, at], lean, np.random.default_rng(seed), direct=direct)
        formulations.append(at.formulation)
        assert outputs(at) == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert formulations[-1] != lean.choose_formulation(base, direct=direct)
    assert len({repr(one) for one in formulations}) > 4


def test_another_subset_may_take_the_place_of_one():
    model = model_of("puma560")
    lean, base = LeanModels(model), make_base_model(model)
    one, other = (Start(name, base, 0.0, 0) for name in ("one", "other"))
    found = [
        vary_start(one, [other], lean, np.random.default_rng(seed), direct=False).heuristic
        for seed in range(30)
    ]
    assert 0 < found.count("other") < found.count("one")
