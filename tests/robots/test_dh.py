import numpy as np
import pytest
from conftest import dh, mechanism_of

from paramreduce_cli.multibody.kinematics import compute_body_poses
from paramreduce_cli.robots.frames import rotate_x, rotate_z


def transform(axis, angle, along):
    """Rotation about and translation along one axis, written out independently."""
    result = np.eye(4)
    i, j = [(1, 2), (2, 0), (0, 1)]["xyz".index(axis)]
    result[i, i] = result[j, j] = np.cos(angle)
    result[i, j], result[j, i] = -np.sin(angle), np.sin(angle)
    result["xyz".index(axis), 3] = along
    return result


@pytest.mark.parametrize("convention", ["modified", "standard"])
@pytest.mark.parametrize("joint", ["revolute", "prismatic"])
def test_one_link_is_the_product_of_its_textbook_transforms(convention, joint):
    mechanism = mechanism_of(dh([("1", None, joint, 0.3, 0.7, 0.2, 0.5)], convention))
    z = 0.4
    theta, d = (0.5 + z, 0.2) if joint == "revolute" else (0.5, 0.2 + z)
    about_x, about_z = transform("x", 0.7, 0.3), transform("z", theta, d)
    expected = about_x @ about_z if convention == "modified" else about_z @ about_x
    assert np.allclose(compute_body_poses(mechanism, np.array([z]))[0], expected, atol=1e-15)


def test_right_angles_are_exact():
    for rotation in (rotate_x, rotate_z):
        for quarters in range(-4, 5):
            assert set(np.abs(rotation(quarters * np.pi / 2)).ravel()) <= {0.0, 1.0}


def test_a_branch_is_placed_on_its_parent():
    rows = [
        ("trunk", None, "revolute", 0, 0, 0, 0),
        ("branch", "trunk", "revolute", 0.1, 0.2, 0.3, 0.0, 0.4, 0.5),
    ]
    mechanism = mechanism_of(dh(rows))
    poses = compute_body_poses(mechanism, np.array([0.6, 0.7]))
    expected = (
        transform("z", 0.6, 0) @ transform("z", 0.4, 0.5) @ transform("x", 0.2, 0.1)
        @ transform("z", 0.7, 0.3)
    )  # fmt: skip
    assert np.allclose(poses[1], expected, atol=1e-15)


def test_table_for_people_shows_angles_as_fractions_of_pi():
    rows = [("1", None, "revolute", 0.1, -np.pi / 2, 0, 0)]
    table = mechanism_of(dh(rows)).table
    assert table[1] == ("1", "base", "revolute", "0.1", "-pi/2", "0", "z_1")


@pytest.mark.parametrize("angle", [1e-9, 1e-6, 1e-5, 0.1, np.pi / 2 + 1e-6, np.pi / 3])
def test_rotations_by_any_angle_are_rotations(angle):
    """Also by angles whose cosine alone looks like that of a right one."""
    for rotation in (rotate_x, rotate_z):
        R = rotation(angle)[:3, :3]
        assert np.abs(R @ R.T - np.eye(3)).max() < 1e-15
