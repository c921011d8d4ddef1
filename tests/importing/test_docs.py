"""Closures over an imported tree, as docs/robots.md describes them."""

import re
from pathlib import Path

import numpy as np
import pytest
from conftest import ONE_FORMAT
from oracles.lagrange import Lagrange, tangent
from robot_files import FOUR_BAR

from paramreduce_cli.config import load_config
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.assembly import assemble
from paramreduce_cli.multibody.random_states import draw_states

ROOT = Path(__file__).parents[2]
QUICK = [
    "trajectories.count=2",
    "trajectories.test_count=1",
    "trajectories.starts=2",
    "trajectories.polished=1",
    ONE_FORMAT,
]

WELD = """\
    closures:
      - {name: weld, type: fixed, bodies: [pin, rocker], at: [[0, 0, 0], [0.7, 0, 0]]}
    independent: [q_crank]
    guess: {q_crank: -1.5, q_coupler: 1, q_rocker: -2, q_pin: -1.5}
"""


def test_closures_over_an_imported_tree(tmp_path, invoke):
    """A four-bar whose pin is welded to the rocker, which over-constrains it."""
    (tmp_path / "four_bar.urdf").write_text(FOUR_BAR)
    path = tmp_path / "four_bar.yaml"
    invoke("init", tmp_path / "four_bar.urdf", "--output", path)
    text = path.read_text()
    assert "pin: {m: 0}" in text
    text = text.replace("\nparameter_sets", WELD + "\nparameter_sets", 1)
    rows = re.search(r"  position_limits:.*?(?=\nselected)", text, re.DOTALL)[0]
    text = text.replace(rows, "  position_limits: [-pi, pi]\n  velocity_limits: 3\n")
    path.write_text(text)
    config = load_config(path)
    with pytest.warns(match="follow from the others"):
        mechanism = assemble(config.build_mechanism())
    assert mechanism.n_dof == 1
    oracle, phi = Lagrange(mechanism), config.get_values()
    states = draw_states(mechanism, 10, np.random.default_rng(0))
    found = Dynamics(mechanism).compute_torques(*states, phi)
    for tau, q, dq, ddq in zip(found, *states, strict=True):
        R = tangent(oracle, mechanism.independent, q)
        expected = R.T @ np.array(oracle.tau(q, dq, ddq, phi)).ravel()
        assert tau == pytest.approx(expected, rel=1e-8)
