"""Which model is taken, and which are worth a look."""

import dataclasses

import numpy as np
import pytest

from paramreduce_cli.judgement.model_selection import (
    find_best_of_size,
    find_nearest_to,
    find_pareto_front,
    find_smallest_within,
    is_proven_smallest,
)
from paramreduce_cli.records import HeuristicValidation, ModelChoice, Operations, Proofs, SetErrors


def judged(n, torque, torque_validation=None, acceleration=None, inverse=None, direct=None):
    """Errors and costs of one heuristic; what is not given does not matter."""
    n = np.asarray(n)
    none = np.zeros((n.size, 0))
    held_out = torque if torque_validation is None else torque_validation
    values = dict.fromkeys((f.name for f in dataclasses.fields(HeuristicValidation)), 0 * n)
    values |= {
        "n": n,
        "torque_error": SetErrors(np.asarray(torque), np.asarray(held_out), none),
        "acceleration_error": SetErrors(
            np.asarray(0 * n if acceleration is None else acceleration), 0 * n, none
        ),
        "operations": Operations(
            np.asarray(10 * n if inverse is None else inverse),
            np.asarray(10 * n if direct is None else direct),
        ),
    }
    return HeuristicValidation(**values)


def test_the_smallest_model_keeps_its_tolerance_on_both_sets():
    results = {
        "a": judged([1, 2, 3], [0.5, 0.009, 0.001], [0.5, 0.02, 0.002]),
        "b": judged([1, 2, 3], [0.5, 0.011, 0.003], [0.5, 0.001, 0.001]),
    }
    assert find_smallest_within(results, {"torque_error": 0.01}) == ("a", 2)
    assert find_smallest_within(results, {"torque_error": 0.02}) == ("a", 1)
    assert find_smallest_within(results, {"torque_error": 1e-5}) is None
    assert find_nearest_to(results, {"torque_error": 1e-5}) == ("a", 2)


def test_several_tolerances_hold_together():
    results = {"a": judged([1, 2, 3], [0.1, 0.01, 0.01], acceleration=[0.3, 0.3, 0.1])}
    both = {"torque_error": 0.05, "acceleration_error": 0.2}
    assert find_smallest_within(results, both) == ("a", 2)
    assert find_smallest_within(results, {**both, "operations": 25}) is None


def test_operations_alone_buy_the_smallest_error():
    results = {"a": judged([1, 2, 3], [0.5, 0.1, 0.01], inverse=[10, 20, 40])}
    assert find_smallest_within(results, {"operations": 30}) == ("a", 1)


def test_of_equal_models_the_last_heuristics_is_taken():
    results = {name: judged([1, 2], [0.5, 0.1]) for name in ("first", "second")}
    results["worse"] = judged([1, 2], [0.5, 0.1001])
    assert find_best_of_size(results, 2) == ("second", 1)
    exact = {name: judged([1], [error]) for name, error in (("a", 1e-16), ("b", 3e-15))}
    assert find_best_of_size(exact, 1) == ("b", 0)
    assert find_best_of_size(results, 7) is None


def test_what_is_proven_necessary():
    zero, bound = np.zeros(3, int), np.array([0.5, 0.1, 0.001])
    empty, status = (zero[:0],) * 3, ("optimal",) * 3
    found = Proofs(np.array([1, 2, 4]), (), empty, bound, bound, status, zero, zero, empty, zero)
    assert is_proven_smallest(found, 4, 0.05)
    assert not is_proven_smallest(found, 4, 0.2)
    assert is_proven_smallest(found, 3, 0.05)
    assert is_proven_smallest(found, 1, 0.9)


@pytest.mark.parametrize("seed", range(5))
def test_the_front_is_what_nothing_beats(seed):
    rng = np.random.default_rng(seed)
    results = {
        name: judged(
            np.arange(1, 9), rng.integers(1, 6, 8) / 10, acceleration=rng.integers(1, 6, 8) / 10,
            inverse=rng.integers(1, 6, 8), direct=rng.integers(1, 6, 8),
        )
        for name in "abc"
    }  # fmt: skip

    def values(name, row):
        found = results[name]
        columns = (found.n, found.torque_error.estimation, found.acceleration_error.estimation,
                   found.operations.inverse, found.operations.direct)  # fmt: skip
        return tuple(column[row] for column in columns)

    everything = {values(name, row) for name in results for row in range(8)}

    def beaten(one):
        return any(two != one and np.all(np.array(two) <= one) for two in everything)

    front = [
        values(m.heuristic, results[m.heuristic].find_row(m.n)) for m in find_pareto_front(results)
    ]
    assert len(front) == len(set(front))
    assert set(front) == {one for one in everything if not beaten(one)}


def test_round_off_is_no_improvement():
    results = {"a": judged([3, 4], [1e-15, 1e-16], inverse=[30, 40], direct=[30, 40])}
    assert find_pareto_front(results) == (ModelChoice("a", 3),)
