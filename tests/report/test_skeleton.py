"""Mechanisms as they are drawn."""

import numpy as np
import pytest
from conftest import config_and_model

from paramreduce_cli.records import BASE
from paramreduce_cli.report.skeleton import animation, skeleton


@pytest.mark.parametrize("robot", ["five_bar", "hexaglide"])
def test_lines_along_closures_are_of_the_bodies_that_they_hold_together(robot):
    _, model = config_and_model(robot)
    mechanism = model.mechanism
    q = mechanism.loops.assembly
    shown = skeleton(model, q)
    for closure, path, bodies in zip(
        mechanism.loops.closures, shown.closures, shown.closure_bodies, strict=True
    ):
        assert len(path) == len(bodies) + 1
        assert [b for b in bodies if b != BASE] == [b for b in closure.bodies if b != BASE]
        ends = [path[0]] if closure.bodies[0] != BASE else []
        ends += [path[-1]] if closure.bodies[1] != BASE else []
        origins = [shown.poses[b][:3, 3] for b in closure.bodies if b != BASE]
        assert np.allclose(ends, origins)
    moving = animation(model, q[None])
    drawn = [body for _, _, body, kind in moving.lines if kind == "loop"]
    assert drawn == [body for bodies in shown.closure_bodies for body in bodies]
    assert max(max(line[:2]) for line in moving.lines) < moving.points.shape[1]
