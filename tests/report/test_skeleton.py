"""Mechanisms as they are drawn."""

import numpy as np
import pytest
from conftest import config_and_model

from paramreduce_cli.records import BASE
from paramreduce_cli.report.skeleton import make_animation, make_skeleton


def test_what_leads_from_a_body_to_the_next_joint_is_part_of_that_body(puma):
    """Its length does not change, and it turns with the body."""
    rng = np.random.default_rng(0)
    moving = make_animation(puma, {"one": rng.normal(size=(5, 6))})
    owners = {body for _, _, body, _ in moving.lines}
    assert owners == {BASE, *range(6)}
    q = np.zeros((2, 6))
    q[1, 2] = 1.0  # the third joint turns: what is on the first two bodies stays
    both = make_animation(puma, {"one": q[:1], "two": q[1:]})
    assert both.motions == (("one", 1), ("two", 1))
    for start, end, body, _ in both.lines:
        moved = np.ptp(both.points[:, [start, end]], axis=0).max() > 1e-9
        assert not moved or body >= 2
    (upper_arm,) = [line for line in moving.lines if line[2] == 1 and line[3] == "link"
                    and np.ptp(moving.points[0][list(line[:2])], axis=0).max() > 0.1]  # fmt: skip
    lengths = np.linalg.norm(np.diff(moving.points[:, upper_arm[:2]], axis=1), axis=2)
    assert lengths == pytest.approx(np.hypot(0.4318, 0.1491))


@pytest.mark.parametrize("robot", ["five_bar", "hexaglide"])
def test_lines_along_closures_are_of_the_bodies_that_they_hold_together(robot):
    _, model = config_and_model(robot)
    mechanism = model.mechanism
    q = mechanism.loops.assembly
    shown = make_skeleton(model, q)
    for closure, path, bodies in zip(
        mechanism.loops.closures, shown.closures, shown.closure_bodies, strict=True
    ):
        assert len(path) == len(bodies) + 1
        assert [b for b in bodies if b != BASE] == [b for b in closure.bodies if b != BASE]
        ends = [path[0]] if closure.bodies[0] != BASE else []
        ends += [path[-1]] if closure.bodies[1] != BASE else []
        origins = [shown.poses[b][:3, 3] for b in closure.bodies if b != BASE]
        assert np.allclose(ends, origins)
    moving = make_animation(model, {"one": q[None]})
    drawn = [body for _, _, body, kind in moving.lines if kind == "loop"]
    assert drawn == [body for bodies in shown.closure_bodies for body in bodies]
    assert max(max(line[:2]) for line in moving.lines) < moving.points.shape[1]
