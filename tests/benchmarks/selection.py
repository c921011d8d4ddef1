"""Forward Selection for every n beside its peers, each at its best: on the same triangular factor.

Ours, scikit-learn's forward search with one fold (its score is then that of the whole matrix, as
ours is), and orthogonal least squares in ten lines of NumPy. The row with raw data and two folds
shows what compressing them first is worth.
"""

import timeit

import numpy as np
from sklearn.feature_selection import SequentialFeatureSelector
from sklearn.linear_model import LinearRegression

from paramreduce_cli.multibody.observation import append_rows
from paramreduce_cli.reduction.criteria.torque import TorqueObjective
from paramreduce_cli.reduction.task import SelectionTask, run
from tests.selecting import problem

RANK, COLUMNS = 36, 60


def matrix():
    """As the PUMA 560's estimation set: 36 independent columns of 60."""
    rng = np.random.default_rng(0)
    mixing = rng.normal(size=(RANK, COLUMNS)) * 10.0 ** rng.uniform(-2, 1, COLUMNS)
    W = rng.normal(size=(6000, RANK)) @ mixing
    return W, W @ rng.normal(size=COLUMNS)


def compressed(W, chi):
    factor = append_rows(np.zeros((0, COLUMNS + 1)), np.column_stack([W, chi]))
    return factor[:, :-1], factor[:, -1]


def ours(W, chi):
    return run("forward-selection", SelectionTask(TorqueObjective(problem(W, chi)))).subsets[-1]


def orthogonal_least_squares(W, chi):
    X, y, order = W / np.linalg.norm(W, axis=0), chi.copy(), []
    for _ in range(RANK):
        squared = np.einsum("ij,ij->j", X, X)
        gains = np.where(squared > 1e-18, (y @ X) ** 2 / np.maximum(squared, 1e-18), -1.0)
        gains[order] = -1.0
        best = int(np.argmax(gains))
        order.append(best)
        direction = X[:, best] / np.sqrt(squared[best])
        X = X - np.outer(direction, direction @ X)
        y = y - direction * (direction @ y)
    return order


def scikit_learn(W, chi, folds, n=COLUMNS - 1):
    """One run of its forward search passes through every number of columns up to n."""
    selector = SequentialFeatureSelector(
        LinearRegression(fit_intercept=False), n_features_to_select=n,
        scoring="neg_mean_squared_error", cv=folds,
    )  # fmt: skip
    return selector.fit(W, chi)


def seconds(function, *arguments, times=1):
    """The least of several runs."""
    return min(timeit.repeat(lambda: function(*arguments), number=1, repeat=times))


def rows():
    W, chi = matrix()
    small = compressed(W, chi)
    everything = [(np.arange(small[1].size),) * 2]
    found = ours(*small)[: RANK - 1], orthogonal_least_squares(*small)[: RANK - 1]
    assert found[0].tolist() == found[1]  # at the rank many columns are as good
    own, plain = [], []
    for _ in range(20):  # in turns, so that both meet the same machine
        own.append(seconds(ours, *small, times=5))
        plain.append(seconds(orthogonal_least_squares, *small, times=5))
    name = "forward selection, 60 columns, every n"
    yield f"{name}: ours / orthogonal least squares in NumPy", min(own) / min(plain), 2
    one_fold = seconds(scikit_learn, *small, everything)
    yield f"{name}: ours / scikit-learn, same factor, one fold", min(own) / one_fold, 1 / 150
    raw = min(own) + seconds(compressed, W, chi, times=5)
    two_folds = seconds(scikit_learn, W, chi, 2)
    yield f"{name}: ours / scikit-learn, 6000 raw rows, two folds", raw / two_folds, 1 / 300
