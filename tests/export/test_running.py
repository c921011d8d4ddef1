"""Exported inverse dynamics, run here."""

import numpy as np
import pytest
from conftest import config_and_model

from paramreduce_cli.export import running
from paramreduce_cli.export.running import RunningModel, compile_model, measure_speeds
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.random_states import draw_states
from paramreduce_cli.reduction.models import make_full_model


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("robot", ["two_link", "five_bar"])
def test_torques_are_those_of_plain_recursion(robot, compiled, monkeypatch):
    if not compiled:
        monkeypatch.setattr(running, "load", lambda *_: None)
    _, model = config_and_model(robot)
    mechanism, chosen = model.mechanism, make_full_model(model)
    states = draw_states(mechanism, 20, np.random.default_rng(0))
    wanted = Dynamics(mechanism).compute_torques(*states, chosen.standard)
    if mechanism.loops is not None:
        R = Coordinates(mechanism).compute_tangent(states[0])[:, list(mechanism.dependent)]
        states = (*states, R)
    found = RunningModel(compile_model(model, chosen), "inverse_dynamics")
    assert found.language == ("C" if compiled else "Python")
    assert found(*states) == pytest.approx(wanted, rel=1e-9, abs=1e-9)
    assert found(*states, repetitions=3) == pytest.approx(wanted, rel=1e-9, abs=1e-9)
    timed = measure_speeds(
        {"full": found, "again": found}, dict(zip(found.takes, states, strict=True))
    )
    assert list(timed.seconds) == ["full", "again"]
    assert min(timed.seconds.values()) > 0


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("robot", ["two_link", "five_bar"])
def test_mass_matrix_and_remainder_give_the_same_torques(robot, compiled, monkeypatch):
    if not compiled:
        monkeypatch.setattr(running, "load", lambda *_: None)
    _, model = config_and_model(robot)
    mechanism, chosen = model.mechanism, make_full_model(model)
    q, dq, ddq = draw_states(mechanism, 20, np.random.default_rng(0))
    z = list(mechanism.independent)
    states = {"q": q, "dq": dq, "ddq": ddq}
    if mechanism.loops is not None:
        coordinates, dependent = Coordinates(mechanism), list(mechanism.dependent)
        still = coordinates.compute_rates(q, dq[:, z], np.zeros((20, len(z))))[1]
        states |= {"R": coordinates.compute_tangent(q)[:, dependent], "b": still[:, dependent]}
    found = RunningModel(compile_model(model, chosen), "direct_dynamics")
    given = found(*(states[name] for name in found.takes))
    n = len(z)
    M, delta = given[:, : n * n].reshape(-1, n, n), given[:, n * n :]
    tau = np.einsum("kij,kj->ki", M, ddq[:, z]) + delta
    assert tau == pytest.approx(
        Dynamics(mechanism).compute_torques(q, dq, ddq, chosen.standard), abs=1e-9
    )
    assert measure_speeds({"full": found}, states).seconds["full"] > 0
