"""Springs whose preload balances gravity, by hand and by the oracle's accelerations."""

import re

import numpy as np
import pytest
from conftest import config_of
from oracles.lagrange import Lagrange, forward_dynamics

from paramreduce_cli.config.loading import load_config
from paramreduce_cli.errors import ConfigError, NumericalError
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.assembly import assemble
from paramreduce_cli.multibody.static_rests import set_static_rests

BEAM = """
robot: beam
description:
  tree:
    points: {{left: [-1, 0, 0.5], right: [2, 0, 0.5], foot_left: [-1, 0, 0], foot_right: [2, 0, 0]}}
    bodies:
      - {{name: heave, joint: prismatic, axes: z, at: [0, 0, 0.5], coordinates: z, massless: true}}
      - {{name: beam, parent: heave, axes: y, coordinates: pitch}}
parameter_sets: {{p: {{beam: {{m: 30, com: [{com}, 0, 0], inertia_com: [1, 0, 0, 9, 0, 9]}}}}}}
forces:
  left: {{type: line, bodies: [base, beam], at: [foot_left, left], stiffness: {stiffness}, rest: static}}
  right: {{type: line, bodies: [base, beam], at: [foot_right, right], stiffness: 5000, rest: static}}
nominal_torque: 10
trajectories: {{position_limits: [-1, 1], velocity_limits: 1}}
"""


def load(tmp_path, text=BEAM, com=0.2, stiffness=2000):
    path = tmp_path / "config.yaml"
    path.write_text(text.format(com=com, stiffness=stiffness))
    return load_config(path)


def test_a_beam_on_two_springs_by_the_lever_rule(tmp_path):
    config = load(tmp_path)
    mechanism = config.build_mechanism()
    assert all(np.isnan(drive.rest) for drive in mechanism.drives)
    found = set_static_rests(mechanism, config.get_values())
    weight = 30 * 9.81
    left, right = weight * 1.8 / 3, weight * 1.2 / 3
    rests = [drive.rest for drive in found.drives]
    assert rests == pytest.approx([0.5 + left / 2000, 0.5 + right / 5000], rel=1e-6)


def test_loops_stay_where_they_are():
    """By the accelerations that Lagrange's equations with multipliers have without any motion."""
    config = config_of("quarter_car", "drives.d_strut.rest=static", "drives.z_wheel.rest=static")
    values = config.get_values()
    mechanism = set_static_rests(assemble(config.build_mechanism()), values)
    q = mechanism.loops.assembly
    independent = list(mechanism.independent)
    nothing = np.zeros(len(independent))
    ddq = forward_dynamics(Lagrange(mechanism), independent, q, np.zeros(q.size), values, nothing)
    assert np.abs(ddq).max() < 1e-8


@pytest.mark.parametrize(
    ("old", "new", "error", "says"),
    [
        ("stiffness: 5000, ", "viscous: 5000, ", ConfigError, "needs a stiffness"),
        ("stiffness: 5000, ", "stiffness: unknown, ", ConfigError, "needs a stiffness"),
        ("rest: static", "rest: statik", ConfigError, "static"),
        (
            "stiffness: {stiffness}, rest: static",
            "stiffness: {stiffness}",
            NumericalError,
            "rest of right: no preloads balance the other forces",
        ),
        (
            "axes: y, coordinates: pitch",
            "joint: prismatic, axes: x, coordinates: pitch",
            NumericalError,
            "right: it acts on no coordinate",
        ),
    ],
)
def test_springs_that_cannot_balance_are_said(tmp_path, old, new, error, says):
    assert old in BEAM
    text = BEAM.replace(old, new)
    if "prismatic" in new:
        text = text.replace("[base, beam], at: [foot_right, right]", "[base, heave], at: [[0, 0, 0.5], [2, 0, 0]]")  # fmt: skip

    def balance():
        config = load(tmp_path, text)
        set_static_rests(config.build_mechanism(), config.get_values())

    with pytest.raises(error, match=re.escape(says)):
        balance()


def test_a_wagon_stands_on_its_wheels():
    """All wheels carry the same weight, and nothing else moves."""
    config = config_of("wagon")
    values = config.get_values()
    mechanism = set_static_rests(config.build_mechanism(), values)
    still = np.zeros((1, mechanism.n_q))
    torques = Dynamics(mechanism, once=True).compute_torques(still, still, still, values)[0]
    rails = [name.startswith(("left_", "right_")) for name in mechanism.coordinate_names]
    weight = 9.81 * (32000 + 2 * 2615 + 4 * 1813)
    assert torques[rails] == pytest.approx(np.full(8, weight / 8), rel=1e-9)
    assert np.abs(torques[~np.array(rails)]).max() < 1e-6 * weight
