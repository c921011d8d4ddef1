"""Units in headings, and what headings are of."""

import pytest

from paramreduce_cli.config.column_headings import read_units, split_unit
from paramreduce_cli.config.column_matching import hold_currents, match_columns

JOINTS = ["a", "b"]


@pytest.mark.parametrize(
    ("heading", "expected"),
    [
        ("q1 [deg]", ("q1", "deg")),
        ("q1[deg]", ("q1", "deg")),
        ("Torque 1 (Nm)", ("Torque 1", "Nm")),
        ("speed_[rad/s]", ("speed", "rad/s")),
        ("q[0]", ("q[0]", "")),
        ("q1", ("q1", "")),
    ],
)
def test_a_unit_is_in_brackets(heading, expected):
    assert split_unit(heading) == expected


def test_units_are_those_of_the_config():
    columns = {"time": "t [ms]", "position": "q{} [deg]", "torque": ["tau1 (Nm)", "tau2 (Nm)"]}
    assert read_units(columns) == {"time": "ms", "position": "deg", "torque": "N m"}
    assert read_units({"position": ["q1 [deg]", "q2 [rad]"], "torque": "tau{} [lbf ft]"}) == {}


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["__time", "q1", "q2", "tau_J1", "tau_J2"],
         {"time": "__time", "position": "q{}", "torque": "tau_J{}"}),
        (["t [s]", "q1 [deg]", "q2 [deg]", "tau1 [Nm]", "tau2 [Nm]"],
         {"time": "t [s]", "position": "q{} [deg]", "torque": "tau{} [Nm]"}),
        (["t", "q1 [deg]", "q2 [rad]", "tau1", "tau2"],
         {"time": "t", "position": ["q1 [deg]", "q2 [rad]"], "torque": "tau{}"}),
        (["t", "pos_a", "pos_b", "eff_a", "eff_b"],
         {"time": "t", "position": ["pos_a", "pos_b"], "torque": ["eff_a", "eff_b"]}),
        (["t", "joint1_pos", "joint2_pos", "joint1_vel", "joint2_vel", "joint1_torque", "joint2_torque"],
         {"time": "t", "position": "joint{}_pos", "velocity": "joint{}_vel", "torque": "joint{}_torque"}),
        (["q1", "q2", "foo"], {"position": "q{}"}),
    ],
    ids=lambda x: x[1] if isinstance(x, list) else "",
)  # fmt: skip
def test_headings_that_people_bring(names, expected):
    assert match_columns(names, JOINTS) == expected


def test_one_joint_needs_no_number():
    names = ["t", "position", "velocity", "torque", "torque_target"]
    assert match_columns(names, ["a"]) == {
        "time": "t", "position": ["position"], "velocity": ["velocity"], "torque": ["torque"],
    }  # fmt: skip


@pytest.mark.parametrize(
    ("columns", "expected"),
    [("i{}", True), ("i{} [mA]", True), ("tau{} [A]", True), ("motor{}_current", True),
     (["actual_current_0", "actual_current_1"], True), ("tau{}", False), ("effort{} [Nm]", False)],
)  # fmt: skip
def test_currents_are_known_by_name_or_unit(columns, expected):
    assert hold_currents(columns) == expected
