"""Other assembly modes that the same guess might have led to, and their base parameters."""

import warnings

import numpy as np
import pytest
from conftest import config_of

from paramreduce_cli.config.schema import ModelSection
from paramreduce_cli.multibody.loops.assembly import assemble, find_assembly_modes
from paramreduce_cli.multibody.loops.closures import express_equations
from paramreduce_cli.records import Run
from paramreduce_cli.robots import Robot
from paramreduce_cli.stages.build_model import build_model

PARALLELOGRAM = {
    "tree": {
        "bodies": [
            {"name": "crank", "axes": "y", "coordinates": "q1"},
            {"name": "coupler", "parent": "crank", "axes": "y", "at": [0.3, 0, 0], "coordinates": "q2"},
            {"name": "rocker", "axes": "y", "at": [0.5, 0, 0], "coordinates": "q3"},
        ],
        "closures": [{"type": "planar", "bodies": ["coupler", "rocker"],
                      "at": [[{"xyz": [0.5, 0, 0]}, {"rx": 1.5707963267948966}], [0.3, 0, 0]]}],
        "independent": ["q1"],
        "guess": {"q1": -1.0, "q2": 1.0, "q3": -1.0},
    }
}  # fmt: skip
BODIES = {name: {"m": 1.0, "com": [0.2, 0.01, 0.02], "inertia_com": [1e-3, 0, 0, 0.02, 0, 0.02]}
          for name in ("crank", "coupler", "rocker")}  # fmt: skip


def parallelogram(**guess):
    tree = {**PARALLELOGRAM["tree"]}
    tree["guess"] = {**tree["guess"], **guess}
    description = {"tree": tree, "gravity": [0.0, 0.0, -9.81]}
    return Robot(
        robot="p", description=description, parameter_sets={"some": BODIES}, nominal_torque=[1]
    )


@pytest.mark.parametrize("robot", ["four_bar", "rssr", "delta"])
def test_modes_are_closed_and_keep_the_independent_coordinates(robot):
    import casadi as ca

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mechanism = assemble(config_of(robot).build_mechanism())
    modes = find_assembly_modes(mechanism)
    assert modes
    q = ca.SX.sym("q", mechanism.n_q)
    gap = ca.Function("gap", [q], [express_equations(mechanism, q)])
    own = mechanism.loops.assembly
    for mode in modes:
        found = mode.loops.assembly
        np.testing.assert_allclose(np.array(gap(found)), 0, atol=1e-8)
        independent = list(mechanism.independent)
        np.testing.assert_array_equal(found[independent], own[independent])
        assert np.abs(found - own).max() > 1e-3


def test_a_parallelogram_and_its_crossed_twin_have_other_base_parameters():
    """The coupler of a parallelogram never turns, so that fewer parameters act; the crossed one's does."""
    with pytest.warns(match="in others nearby with the same independent coordinates"):
        straight = build_model(parallelogram(), ModelSection(), Run())
    (mode,) = find_assembly_modes(straight.mechanism)
    names = straight.mechanism.generalised_names
    guess = dict(zip(names, mode.loops.assembly.tolist(), strict=True))
    with pytest.warns(match=f"and {straight.base.columns.size} in others nearby"):
        crossed = build_model(parallelogram(**guess), ModelSection(), Run())
    assert crossed.base.columns.size > straight.base.columns.size


def test_nothing_is_said_where_all_modes_are_alike():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        build_model(config_of("rssr"), ModelSection(), Run())
    assert not any("in others nearby" in str(one.message) for one in caught)
