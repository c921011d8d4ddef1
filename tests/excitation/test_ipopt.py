import numpy as np
import pytest
from scipy.optimize import rosen, rosen_der

from paramreduce_cli.excitation.ipopt import TIGHT, minimise


def test_finds_the_minimum_of_a_curved_valley():
    start = np.array([-1.2, 1.0, -1.2, 1.0])
    end = minimise(lambda x: (rosen(x), rosen_der(x)), start, 500, stopping=TIGHT)
    assert end.x == pytest.approx(np.ones(4), abs=1e-2)
    assert end.iterations > 5
    assert end.value == pytest.approx(rosen(end.x))


def test_keeps_the_best_point_when_it_runs_out_of_iterations():
    start = np.array([-1.2, 1.0])
    end = minimise(lambda x: (rosen(x), rosen_der(x)), start, 3)
    assert end.value <= rosen(start)
    assert end.status == "Maximum_Iterations_Exceeded"


def test_an_interruption_ends_the_search():
    calls = []

    def objective(x):
        calls.append(x)
        if len(calls) == 5:
            raise KeyboardInterrupt
        return rosen(x), rosen_der(x)

    with pytest.raises(KeyboardInterrupt):
        minimise(objective, np.array([-1.2, 1.0]), 500)
    assert len(calls) < 20


def test_curvature_is_carried_over():
    A = np.diag([1.0, 100.0])
    first = minimise(lambda x: (float(x @ A @ x) / 2, A @ x), np.array([3.0, 1.0]), 50)
    assert np.linalg.eigvalsh(first.curvature).min() > 0
    second = minimise(
        lambda x: (float(x @ A @ x) / 2, A @ x), np.array([2.0, 2.0]), 50, first.curvature
    )
    assert second.iterations <= first.iterations
