"""Lean position, velocity and acceleration problems of loops against sparse solvers with row exchanges."""

import numpy as np
import pytest
from conftest import model_of

from paramreduce_cli.lean.loop_kinematics import LoopKinematics
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.random_states import draw_states

COUNT = 100


@pytest.fixture(scope="module", params=["four_bar", "five_bar", "hexaglide", "quarter_car"])
def solved(request):
    """A mechanism, and its states with R and b by another solver."""
    mechanism = model_of(request.param).mechanism
    q, dq, ddq = draw_states(mechanism, COUNT, np.random.default_rng(7))
    d, z = list(mechanism.dependent), list(mechanism.independent)
    R = Coordinates(mechanism, once=True).compute_tangent(q)[:, d]
    b = ddq[:, d] - np.einsum("kij,kj->ki", R, ddq[:, z])
    values = {"q": q, "dq": dq, "ddq": ddq, "dz": dq[:, z], "ddz": ddq[:, z], "R": R, "b": b}
    return mechanism, values | {"step": np.zeros_like(b)}


def evaluate(function, values):
    """Return the results of a function by name."""
    inputs = [c for a in function.arguments for c in values[a.name].reshape(-1, a.size).T]
    outputs = function.program.evaluate(inputs)
    found = {}
    for array in function.results:
        own, outputs = outputs[: array.size], outputs[array.size :]
        found[array.name] = np.column_stack([np.broadcast_to(x, len(values["q"])) for x in own])
    return found


def test_problems_are_solved(solved):
    mechanism, values = solved
    kinematics = LoopKinematics(mechanism)
    for function in kinematics.make_problems():
        found = evaluate(function, values)
        trusted = (np.abs(found.pop("pivots")) >= kinematics.least_pivots).all(axis=1)
        assert trusted.mean() > 0.95
        for name, got in found.items():
            expected = values[name].reshape(got.shape)
            assert np.abs(got - expected)[trusted].max() < 1e-10 * max(1, np.abs(expected).max())


def test_newtons_correction_closes_the_loops(solved):
    mechanism, values = solved
    newton = LoopKinematics(mechanism).make_newton()
    rng = np.random.default_rng(1)
    d = list(mechanism.dependent)
    off = values["q"].copy()
    off[:, d] += 1e-4 * rng.uniform(-1, 1, size=(COUNT, len(d)))
    for least in (1e-6, 1e-10):
        off[:, d] += evaluate(newton, {"q": off})["step"]
        assert np.median(np.abs(off - values["q"]).max(axis=1)) < least
