"""Masses, sizes and speeds that other units than SI would explain."""

import warnings

import pytest
from conftest import CONFIGS
from hypothesis import given, settings
from hypothesis import strategies as st

from paramreduce_cli.config import load_config

ARM = """\
robot: arm
description:
  gravity: [0, 0, -{gravity}]
  tree:
    bodies:
      - {{name: upper, at: [0, 0, 0.3]}}
      - {{name: fore, parent: upper, at: [0.4, 0, 0]}}
parameter_sets:
  cad:
    upper: {{m: {mass}, com: [{far}, 0, 0.01], inertia_com: [{inertia}, 0, 0, {inertia}, 0, {inertia}]}}
    fore: {{m: 1, com: [0.1, 0, 0], inertia_com: [0.002, 0, 0, 0.01, 0, 0.01]}}
trajectories: {{position_limits: [-1, 1], velocity_limits: {speed}}}
"""


def said(tmp_path, mass=2.0, far=0.2, inertia=0.02, speed=2.0, gravity=9.81):
    path = tmp_path / "arm.yaml"
    path.write_text(ARM.format(mass=mass, far=far, inertia=inertia, speed=speed, gravity=gravity))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        load_config(path)
    return [str(one.message) for one in caught]


@pytest.mark.parametrize(
    ("odd", "says"),
    [
        ({"far": 250, "mass": 2000, "inertia": 200}, "upper: a centre of mass up to 250 m from the joint, on a robot of about 0.7 m"),
        ({"mass": 1400, "inertia": 4e6}, "upper: an inertia as of a body of up to 65.5 m around"),
        ({"mass": 2000.0}, "upper: an inertia so small for its mass that the body is denser than any metal"),
        ({"inertia": 1e-6}, "denser than any metal"),
        ({"gravity": 9810}, "description.gravity of 9810 is in m/s^2, not mm/s^2"),
        ({"speed": 180}, "velocity_limits of 180 are in rad/s (m/s), not degrees"),
    ],
)  # fmt: skip
def test_odd_ones_are_said_once_and_taken_as_they_are(tmp_path, odd, says):
    (message,) = said(tmp_path, **odd)
    assert says in message
    assert message.endswith("going on")


@settings(max_examples=40, deadline=None)
@given(
    size=st.floats(0.02, 1.0), density=st.floats(20, 20_000), shape=st.floats(1, 4), speed=st.floats(0.1, 60)
)  # fmt: skip
def test_solid_and_hollow_bodies_of_a_robot_are_not_odd(
    tmp_path_factory, size, density, shape, speed
):
    """Balls and rods of any material, hollow ones by a small density; shape is length over width."""
    mass = density * size**3 / shape**2
    inertia = mass * (0.1 * size**2 + size**2 / 12)
    assert not said(tmp_path_factory.mktemp("arm"), mass, 0.5 * size, inertia, speed)


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.stem)
def test_nothing_is_said_of_robots_that_come_along(path):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        load_config(path)
    assert not [
        one
        for one in caught
        if "are masses in g" in str(one.message) or "not degrees" in str(one.message)
    ]
