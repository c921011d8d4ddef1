import numpy as np
import pytest
from conftest import PUMA_ROWS, mechanism_of, puma_mechanism, random_states
from hypothesis import given
from hypothesis import strategies as st

from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.kinematics import compute_body_poses
from paramreduce_cli.records import JOINT_AXES, JOINT_COORDINATES
from paramreduce_cli.robots.frames import rotate_x, rotate_y, rotate_z, translate
from paramreduce_cli.robots.tree import list_joint_motions, rotate_z_to

unit = st.floats(-1, 1)


@given(st.tuples(unit, unit, unit).filter(lambda v: np.linalg.norm(v) > 1e-3))
def test_rotation_takes_z_to_the_axis(axis):
    R = rotate_z_to(np.array(axis))
    assert R[:, 2] == pytest.approx(np.array(axis) / np.linalg.norm(axis), abs=1e-12)
    assert pytest.approx(np.eye(3), abs=1e-12) == R @ R.T
    assert np.linalg.det(R) == pytest.approx(1)


@pytest.mark.parametrize("axis", [*np.eye(3), *-np.eye(3)])
def test_rotations_to_the_six_axes_are_exact(axis):
    R = rotate_z_to(axis)
    assert np.array_equal(R[:, 2], axis)
    assert set(np.abs(R).ravel()) == {0.0, 1.0}


@pytest.mark.parametrize("kind", list(JOINT_COORDINATES))
def test_joints_have_the_coordinates_and_axes_they_are_said_to_have(kind):
    axes = np.eye(3)[: JOINT_AXES[kind]].tolist()
    assert len(list_joint_motions(kind, axes)) == len(list_joint_motions(kind, []))
    assert len(list_joint_motions(kind, [])) == JOINT_COORDINATES[kind]


@pytest.mark.parametrize(
    ("kind", "turns"),
    [
        ("universal", lambda a, b, c: rotate_x(a) @ rotate_y(b)),
        ("spherical", lambda a, b, c: rotate_x(a) @ rotate_y(b) @ rotate_z(c)),
    ],
)
def test_order_of_turns(kind, turns):
    names = ["a", "b", "c"][: JOINT_COORDINATES[kind]]
    at = [{"rz": 0.4}, {"xyz": [1, 2, 3]}]
    body = {"name": "body", "joint": kind, "at": at, "coordinates": names}
    mechanism = mechanism_of({"tree": {"bodies": [body]}})
    angles = np.array([0.3, -0.7, 1.1])
    pose = compute_body_poses(mechanism, angles[: len(names)])[-1]
    placement = rotate_z(0.4) @ translate(1, 2, 3)
    assert pose == pytest.approx(placement @ turns(*angles), abs=1e-14)
    assert [b.intermediate for b in mechanism.bodies] == [True] * (len(names) - 1) + [False]
    assert mechanism.parameter_names[0] == "m_body"
    assert mechanism.n_parameters == 10


def test_a_chain_is_the_same_by_frames_and_by_denavit_hartenberg():
    rows = [
        {"name": str(k + 1), "parent": str(k) if k else "base",
         "at": [{"rx": alpha}, {"xyz": [a, 0, 0]}, {"xyz": [0, 0, d]}]}
        for k, (a, alpha, d) in enumerate(PUMA_ROWS)
    ]  # fmt: skip
    mechanism = mechanism_of({"tree": {"bodies": rows}})
    states = random_states(mechanism, 5)
    expected = Dynamics(puma_mechanism()).compute_regressor(*states)
    assert Dynamics(mechanism).compute_regressor(*states) == pytest.approx(expected, abs=1e-10)
