"""How the cost of a chain of right-angled joints grows with their number."""

import itertools
import time

import numpy as np

from paramreduce_cli.lean import search
from paramreduce_cli.multibody.base_parameters import affecting_columns, base_parameters
from paramreduce_cli.multibody.dynamics import Dynamics
from tests.conftest import dh, mechanism_of, random_states

SHORT, LONG = 12, 24
SQUARE = (LONG / SHORT) ** 2
ANGLES = (0, np.pi / 2, -np.pi / 2, np.pi / 2, 0, -np.pi / 2)
STATES = 500


def chain(n):
    rows = [
        (str(k + 1), str(k) if k else None, "revolute", 0.1 * (k % 3), angle, 0.2 * (k % 2))
        for k, angle in zip(range(n), itertools.cycle(ANGLES), strict=False)
    ]
    return mechanism_of(dh(rows))


def seconds(work):
    started = time.process_time()
    return work(), time.process_time() - started


def measured(n):
    """CPU seconds of the evaluated regressor, of the base parameters and of the search."""
    mechanism = chain(n)
    dynamics, states = Dynamics(mechanism), random_states(mechanism, STATES)
    dynamics.regressor(*states)  # compiles
    K, regressor = seconds(lambda: dynamics.regressor(*states))
    W = K.reshape(-1, K.shape[2])
    base, ranks = seconds(lambda: base_parameters(W, mechanism.preference_order, 1e-8))
    affecting = affecting_columns(W)
    _, searched = seconds(lambda: search.formulations(mechanism, affecting, base.columns))
    return np.array([regressor, ranks, searched])


def rows():
    ratios = measured(LONG) / measured(SHORT)
    joints = f"{LONG} / {SHORT} joints"
    yield f"regressor of {STATES} states, CPU time: {joints}", ratios[0], SQUARE
    # Rows grow as the joints, columns too: a factorisation takes the cube.
    yield f"base parameters, CPU time: {joints}", ratios[1], SQUARE * LONG / SHORT
    yield f"search for formulations, CPU time: {joints}", ratios[2], SQUARE
