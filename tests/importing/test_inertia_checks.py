"""What is said of inertias in files."""

import numpy as np

from paramreduce_cli.importing.imported_robot import Inertial
from paramreduce_cli.importing.inertia_checks import find_inertia_warnings

ROD = np.diag([1e-4, 1 / 12, 1 / 12])
MIDDLE = np.array([0.5, 0.0, 0.0])


def said(**links):
    return list(find_inertia_warnings(links))


def test_a_rod_about_its_middle_is_as_it_should_be():
    assert said(rod=Inertial(1.0, MIDDLE, ROD), none=None, frame=Inertial()) == []


def test_a_rod_about_its_end_is_noticed():
    (sentence,) = said(rod=Inertial(1.0, MIDDLE, np.diag([1e-4, 1 / 3, 1 / 3])))
    assert sentence.startswith("rod: ")
    assert "about the link's origin" in sentence


def test_impossible_bodies_are_named_once_each():
    impossible = np.diag([1.0, 0.1, 0.1])
    found = said(
        light=Inertial(-1.0, MIDDLE, ROD),
        ghost=Inertial(0.0, MIDDLE, ROD),
        **{f"plate{k}": Inertial(1.0, np.zeros(3), impossible) for k in range(10)},
    )
    assert found[:2] == ["light: a mass below zero", "ghost: an inertia but no mass"]
    assert "plate7 and 2 more: an inertia that no distribution of mass has" in found[2]
    assert len(found) == 3
