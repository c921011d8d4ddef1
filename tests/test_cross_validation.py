import numpy as np
import pytest

from paramreduce_cli.judgement.cross_validation import (
    choose_by_bounded_loss,
    choose_by_one_standard_error,
    compute_largest_loss,
    cross_validate,
)
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
    assert choose_by_bounded_loss({"some": found}).n == 3
    np.testing.assert_allclose(found.full_error, found.torque_error[:, -1])


def test_the_smallest_within_one_standard_error():
    errors = np.array([[0.5, 0.21, 0.2, 0.3], [0.5, 0.25, 0.24, 0.3]])
    result = CrossValidation(np.array([1, 2, 3, 4]), errors, errors[:, -1])
    assert choose_by_one_standard_error({"one": result}).n == 2  # 0.23 is within 0.22 + 0.02
    better = CrossValidation(np.array([1, 2, 3, 4]), errors - 0.005, errors[:, -1])
    choice = choose_by_one_standard_error({"one": result, "two": better})
    assert (choice.heuristic, choice.n) == ("two", 2)


def test_the_interval_of_the_loss_is_students():
    reference = np.array([1.0, 2.0, 4.0])
    errors = reference * [1.0, 1.1, 1.2]
    # Mean 0.1, deviation 0.1; 1.886 is the 90 % quantile of Student's distribution with two degrees of freedom.
    assert compute_largest_loss(errors, reference) == pytest.approx(
        0.1 + 1.886 * 0.1 / np.sqrt(3), rel=1e-3
    )


def test_the_bounded_loss_is_against_the_best_and_against_all_parameters():
    sizes = np.array([1, 2, 3, 4])
    steady = np.ones((5, 1))
    errors = steady * [0.2, 0.1, 0.09, 0.1]
    assert choose_by_bounded_loss({"a": CrossValidation(sizes, errors, np.full(5, 0.1))}).n == 3
    errors = steady * [0.2, 0.102, 0.1, 0.1]
    assert choose_by_bounded_loss({"a": CrossValidation(sizes, errors, np.full(5, 0.1))}).n == 2
    # All parameters are better than any subset: no subset is good enough, so the best one is taken.
    assert choose_by_bounded_loss({"a": CrossValidation(sizes, errors, np.full(5, 0.08))}).n == 3
    # One fold may be worse by chance.
    errors[0, 1] = 0.14
    assert choose_by_bounded_loss({"a": CrossValidation(sizes, errors, np.full(5, 0.1))}).n == 3
