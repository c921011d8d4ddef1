import numpy as np
import pytest

from paramreduce_cli.judgement.cross_validation import choose_by_one_standard_error, cross_validate
from paramreduce_cli.records import CrossValidation
from paramreduce_cli.reduction.problem import SelectionProblem


def made(seed=0, folds=5, rows=40, n=8, active=3):
    rng = np.random.default_rng(seed)
    W = rng.normal(size=(folds, rows, n))
    phi = np.zeros(n)
    phi[:active] = [3.0, -2.0, 1.0]
    chi = W @ phi + 0.5 * rng.normal(size=(folds, rows))
    return W, chi


def test_errors_are_those_of_fits_without_each_fold():
    W, chi = made()
    everything = np.arange(8)

    def factor(k):
        return np.column_stack([W[k].reshape(-1, 8), chi[k].ravel()])

    folds = [(factor(np.delete(everything[:5], k)), factor([k])) for k in range(5)]
    whole = factor(everything[:5])
    problem = SelectionProblem(whole[:, :-1], whole[:, -1], everything, everything)
    found = cross_validate(problem, folds, lambda _: [everything[: k + 1] for k in range(8)])
    assert found.n.tolist() == list(range(1, 9))
    for k in range(5):
        rest = np.delete(everything[:5], k)
        for n in (1, 3, 8):
            phi = np.linalg.lstsq(W[rest].reshape(-1, 8)[:, :n], chi[rest].ravel(), rcond=None)[0]
            expected = np.linalg.norm(chi[k] - W[k][:, :n] @ phi) / np.linalg.norm(chi[k])
            assert found.torque_error[k, n - 1] == pytest.approx(expected)
    assert choose_by_one_standard_error({"some": found}).n == 3


def test_the_smallest_within_one_standard_error():
    errors = np.array([[0.5, 0.21, 0.2, 0.3], [0.5, 0.25, 0.24, 0.3]])
    result = CrossValidation(np.array([1, 2, 3, 4]), errors)
    assert choose_by_one_standard_error({"one": result}).n == 2  # 0.23 is within 0.22 + 0.02
    better = CrossValidation(np.array([1, 2, 3, 4]), errors - 0.005)
    choice = choose_by_one_standard_error({"one": result, "two": better})
    assert (choice.heuristic, choice.n) == ("two", 2)
