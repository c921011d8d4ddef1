"""Planar loops in planes that are parallel to none of the base's: equations that vanish are round-off there."""

import casadi as ca
import numpy as np
import pytest
from loop_texts import SLIDER, load_text

from paramreduce_cli.errors import ParamreduceWarning
from paramreduce_cli.multibody.loops.assembly import assemble
from paramreduce_cli.multibody.loops.closures import express_equations

ANGLES = np.random.default_rng(0).uniform(-3, 3, size=(12, 3)).round(3).tolist()


@pytest.mark.parametrize("angles", [[0.4, -0.7, 0.0], *ANGLES], ids=str)
def test_a_slider_has_two_equations_in_any_plane(tmp_path, angles):
    turns = ", ".join(f"{{r{axis}: {a}}}" for axis, a in zip("xyz", angles, strict=True))
    with pytest.warns(ParamreduceWarning, match="of the 5 equations that close the loops 2 are"):
        mechanism = assemble(load_text(tmp_path, SLIDER, turns=turns).build_mechanism())
    assert len(mechanism.loops.kept) == 2
    q = ca.SX.sym("q", 3)
    phi = express_equations(mechanism, q)
    jacobian = ca.Function("J", [q], [ca.jacobian(phi, q)])(mechanism.loops.assembly).full()
    kept = jacobian if len(jacobian) == 2 else jacobian[list(mechanism.loops.kept)]
    assert np.linalg.cond(kept) < 100
