"""Which parameters have an effect does not depend on the size of the robot, on gears or on units."""

import numpy as np
import pytest
from oracles.pinocchio_model import inverse_dynamics

from paramreduce_cli.config.loading import load_config
from paramreduce_cli.multibody.base_parameters import choose_base, find_affecting_parameters
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.random_states import draw_states

CONFIG = """
robot: arm
description:
  gravity: [0, 0, {gravity}]
  tree:
    bodies:
      - {{name: b0, axes: z, at: [{{rx: 1.1}}]}}
      - {{name: b1, parent: b0, axes: z, at: [{{xyz: [{a}, 0, {b}]}}]}}
      - {{name: b2, parent: b1, axes: z, at: [{{xyz: [{a}, 0, 0]}}, {{rx: -pi/2}}]}}
      - {{name: b3, parent: b2, joint: prismatic, axes: z, at: [{{xyz: [0, {b}, 0]}}]}}
drives:
  q_b1: {{motion: {{q_b1: {ratio}}}, inertia: {rotor}, viscous: {rotor}}}
parameter_sets: {{p: {{b0: {{m: 1}}, b1: {{m: 1}}, b2: {{m: 1}}, b3: {{m: 1}}}}}}
trajectories: {{position_limits: [-3, 3], velocity_limits: 3}}
"""
SIZES = [
    (1e-3, 1e-6, 1),
    (1e-3, 1e-6, 5000),
    (0.3, 1, 1),
    (0.3, 1, 200),
    (50, 1e5, 1),
    (50, 1e5, 5000),
]
"""Length of a link, m, mass of a body, kg, ratio of the gear."""


def arm(folder, length, ratio, gravity):
    path = folder / "config.yaml"
    path.write_text(CONFIG.format(a=length, b=length / 4, ratio=ratio, rotor=1e-9, gravity=gravity))
    return load_config(path).build_mechanism()


def effects(mechanism):
    K = Dynamics(mechanism).compute_regressor(
        *draw_states(mechanism, 100, np.random.default_rng(0))
    )
    affects = find_affecting_parameters(mechanism, K)
    W = K.reshape(-1, K.shape[2])
    return affects, choose_base(W, mechanism.preference_order, 1e-9, affects)


@pytest.mark.parametrize("gravity", [0.0, -9.81])
@pytest.mark.parametrize(("length", "mass", "ratio"), SIZES)
def test_all_sizes_have_the_same_base_parameters(tmp_path, length, mass, ratio, gravity):
    usual, usual_base = effects(arm(tmp_path, 0.3, 1, gravity))
    affects, base = effects(arm(tmp_path, length, ratio, gravity))
    np.testing.assert_array_equal(affects, usual)
    np.testing.assert_array_equal(base.columns, usual_base.columns)


@pytest.mark.parametrize(("length", "mass", "ratio"), SIZES)
def test_what_has_no_effect_is_missing_in_no_torque(tmp_path, length, mass, ratio):
    mechanism = arm(tmp_path, length, ratio, -9.81)
    affects, _ = effects(mechanism)
    rng = np.random.default_rng(0)
    sizes = [mass, *3 * [mass * length], *6 * [mass * length**2]]
    phi = rng.uniform(0.5, 1, mechanism.n_parameters) * np.array([*sizes * 4, 1e-9, 1e-9])
    q, dq, ddq = draw_states(mechanism, 50, np.random.default_rng(1))
    expected = inverse_dynamics(mechanism, phi[:40], q, dq, ddq)
    found = Dynamics(mechanism).compute_torques(q, dq, ddq, np.where(affects, phi, 0.0))
    found[:, 1] -= (phi[40] * ddq[:, 1] + phi[41] * dq[:, 1]) * ratio**2
    off = np.abs(found - expected).max(axis=0)
    drive = np.abs(phi[40:]).max() * ratio**2
    scale = np.abs(expected).max(axis=0) + np.array([0, drive * 1e-6, 0, 0])
    assert np.all(off < 1e-9 * scale)
