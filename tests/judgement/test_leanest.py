"""The leanest function within tolerances, against all that there are."""

from types import SimpleNamespace

import numpy as np
import pytest

from paramreduce_cli.config.schema import SelectedSection
from paramreduce_cli.judgement.leanest import find_leanest
from paramreduce_cli.records import ModelErrors, Operations, SetErrors

RESULTS = {
    "qr": SimpleNamespace(
        n=np.array([1, 3, 5]),
        torque_error=SetErrors(
            np.array([0.9, 0.02, 0.004]),
            np.array([0.9, 0.03, 0.005]),
            np.array([[0.9, 0.8], [0.03, 0.01], [0.006, 0.002]]),
        ),
        acceleration_error=SetErrors(
            np.array([np.inf, 0.05, 0.01]), np.array([np.inf, 0.05, 0.02]), np.zeros((0, 0))
        ),
        operations=Operations(np.array([2, 100, 200]), np.array([3, 150, 300])),
        mass_matrix=SimpleNamespace(smallest_eigenvalue=np.array([0.0, -0.1, 0.1])),
    ),
    "swap": SimpleNamespace(
        n=np.array([6, 4]),
        torque_error=SetErrors(
            np.array([0.0085, 0.008]),
            np.array([0.009, 0.009]),
            np.array([[0.01, 0.02], [0.01, 0.03]]),
        ),
        acceleration_error=SetErrors(
            np.array([0.03, 0.03]), np.array([0.04, 0.04]), np.zeros((0, 0))
        ),
        operations=Operations(np.array([140, 140]), np.array([250, 250])),
        mass_matrix=SimpleNamespace(smallest_eigenvalue=np.array([0.1, 0.1])),
    ),
}


def terms(torque, acceleration, operations=50, held_out=None, budget=0.1):
    """Both functions with such errors, of a budget of 4 % and so much of accelerations."""
    one = SimpleNamespace(
        operations=operations,
        torque_error=ModelErrors(torque, torque if held_out is None else held_out, np.zeros(0)),
        acceleration_error=ModelErrors(acceleration, acceleration, np.zeros(0)),
    )
    return SimpleNamespace(
        torque_budget=0.04, acceleration_budget=budget, held_out=held_out is not None,
        functions={"inverse": one, "direct": one},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("wanted", "found", "inverse", "direct"),
    [
        ({}, None, "swap:4", "swap:4"),  # within 1 %
        ({"torque_error": 0.03}, None, "qr:3", "swap:4"),  # the smallest M is not positive definite
        ({"torque_error": 0.006}, None, "qr:5", "qr:5"),
        ({"torque_error": 0.001}, None, None, None),
        ({"torque_error": 0.03, "acceleration_error": 0.035}, None, "qr:3", "qr:5"),
        ({}, terms(0.035, 0.09), "terms", "terms"),  # within what terms were left out within
        ({"n": 4}, terms(0.035, 0.09), "terms", "terms"),
        ({"torque_error": 0.03}, terms(0.035, 0.09), "qr:3", "swap:4"),
        ({"acceleration_error": 0.045}, terms(0.035, 0.09), "terms", "swap:4"),
        ({"acceleration_error": 0.045}, None, "swap:4", "swap:4"),  # d within 1 %, as it has none
        ({}, terms(0.035, np.inf, budget=np.inf), "terms", "terms"),
        ({}, terms(0.05, 0.09, budget=np.inf), "qr:3", "swap:4"),
        (
            {},
            terms(0.035, 0.09, held_out=0.06),
            "terms",
            "terms",
        ),  # the budget is not on what is held out
        ({"torque_error": 0.04}, terms(0.035, 0.09, held_out=0.06), "qr:3", "swap:4"),
        ({"torque_error": 0.03}, terms(0.02, np.nan), "terms", "terms"),
        ({"torque_error": 0.03}, terms(0.02, 0.09, operations=120), "qr:3", "terms"),
        ({"torque_error": 0.03, "operations": 10}, terms(np.nan, 0.01), "qr:3", "swap:4"),
    ],
)
def test_the_fewest_operations_within_what_is_asked_for(wanted, found, inverse, direct):
    for function, expected in (("inverse", inverse), ("direct", direct)):
        one = find_leanest(function, SelectedSection(**wanted), RESULTS, found)
        assert (one and one.model) == expected
        if expected is not None and expected != "terms":
            heuristic, _, n = expected.partition(":")
            row = RESULTS[heuristic].n.tolist().index(int(n))
            assert one.operations == RESULTS[heuristic].operations[function][row]
            assert one.torque_error.validation == RESULTS[heuristic].torque_error.validation[row]
            test = RESULTS[heuristic].torque_error.test[row]
            assert one.torque_error.test.tolist() == test.tolist()
