"""Forward Selection for every n against scikit-learn, on the same 6000 x 60 matrix."""

import time

import numpy as np
from sklearn.feature_selection import SequentialFeatureSelector
from sklearn.linear_model import LinearRegression

from paramreduce_cli.multibody.observation import append_rows
from paramreduce_cli.reduction.problem import SelectionProblem
from paramreduce_cli.reduction.task import Task, run
from paramreduce_cli.reduction.torque import TorqueObjective


def matrix():
    """As the PUMA 560's estimation set: 36 independent columns of 60."""
    rng = np.random.default_rng(0)
    W = rng.normal(size=(6000, 36)) @ (rng.normal(size=(36, 60)) * 10.0 ** rng.uniform(-2, 1, 60))
    return W, W @ rng.normal(size=60)


def ours(W, chi):
    factor = append_rows(np.zeros((0, 61)), np.column_stack([W, chi]))
    columns = np.arange(60)
    problem = SelectionProblem(factor[:, :-1], factor[:, -1], columns, columns)
    return run("forward-selection", Task(TorqueObjective(problem)))


def theirs(W, chi):
    """One run of its forward search passes through every n up to 59."""
    selector = SequentialFeatureSelector(
        LinearRegression(fit_intercept=False),
        n_features_to_select=59,
        direction="forward",
        scoring="neg_mean_squared_error",
        cv=2,
    )
    return selector.fit(W, chi)


def rows():
    W, chi = matrix()
    ours(W, chi)
    times = []
    for _ in range(5):
        started = time.perf_counter()
        ours(W, chi)
        times.append(time.perf_counter() - started)
    started = time.perf_counter()
    theirs(W, chi)
    other = time.perf_counter() - started
    yield (
        "forward selection, 6000 x 60, every n: ours / scikit-learn",
        np.median(times) / other,
        1 / 500,
    )
