"""Exported inverse dynamics, run here."""

import numpy as np
import pytest
from conftest import config_and_model

from paramreduce_cli.export import running
from paramreduce_cli.export.running import RunningModel, speed
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.random_states import random_states
from paramreduce_cli.reduction.models import full_model


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("robot", ["two_link", "five_bar"])
def test_torques_are_those_of_plain_recursion(robot, compiled, monkeypatch):
    if not compiled:
        monkeypatch.setattr(running, "load", lambda *_: None)
    _, model = config_and_model(robot)
    mechanism, chosen = model.mechanism, full_model(model)
    states = random_states(mechanism, 20, np.random.default_rng(0))
    wanted = Dynamics(mechanism).inverse(*states, chosen.standard)
    if mechanism.loops is not None:
        R = Coordinates(mechanism).tangent(states[0])[:, list(mechanism.dependent)]
        states = (*states, R)
    found = RunningModel(model, chosen)
    assert found.language == ("C" if compiled else "Python")
    assert found(*states) == pytest.approx(wanted, rel=1e-9, abs=1e-9)
    assert found(*states, rounds=3) == pytest.approx(wanted, rel=1e-9, abs=1e-9)
    timed = speed({"full": found, "again": found}, states)
    assert list(timed.seconds) == ["full", "again"]
    assert min(timed.seconds.values()) > 0
