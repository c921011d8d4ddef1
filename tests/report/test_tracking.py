"""Computed-torque control on a pendulum whose answer is known, and in the report."""

import numpy as np
import pytest
from conftest import CONFIGS

from paramreduce_cli.report.tracking import point_to_point, simulate

INERTIA, WEIGHT = 0.4, 3.0


def arm(z, dz, tau):
    return (tau - WEIGHT * np.cos(z)) / INERTIA


def model(share=1.0):
    return lambda z, dz, ddz: share * INERTIA * ddz + share * WEIGHT * np.cos(z)


def path(period=1e-3, moves=3):
    one = np.ones(1)
    return point_to_point(-one, one, 2 * one, moves, period, seed=1)


def test_paths_start_and_end_at_rest_and_keep_to_speeds():
    made = path()
    assert np.all(np.abs(made.dz) <= 2 + 1e-9)
    assert np.all(np.abs(made.z) <= 1 + 1e-9)
    assert made.dz[0] == 0
    step = made.time[1] - made.time[0]
    np.testing.assert_allclose(np.gradient(made.z[:, 0], step)[5:-5], made.dz[5:-5, 0], atol=1e-3)
    jumps = np.abs(np.diff(made.ddz[:, 0])).max()
    assert jumps < 0.2 * np.abs(made.ddz).max()


def test_the_right_model_follows_as_well_as_its_period_allows():
    coarse, fine = (np.abs(simulate(path(h), model(), arm, 20.0)).max() for h in (4e-3, 1e-3))
    assert fine < 1e-4
    assert fine < 0.4 * coarse


def test_a_wrong_model_is_off_by_what_feedback_leaves():
    """At rest w^2 e INERTIA share = (1 - share) WEIGHT cos z."""
    slow = point_to_point(np.zeros(1), np.full(1, 1e-9), np.ones(1), 1, 1e-3, seed=0)
    long = type(slow)(
        np.arange(3000) * 1e-3,
        *(np.repeat(x[:1], 3000, axis=0) for x in (slow.z, slow.dz, slow.ddz)),
    )
    errors = simulate(long, model(0.9), arm, 20.0)
    expected = 0.1 * WEIGHT / (0.9 * INERTIA * 20.0**2)
    assert errors[-1, 0] == pytest.approx(expected, rel=1e-3)


def test_the_report_shows_tracking_where_it_is_asked_for(invoke, two_link_copy):
    code, _, err = invoke(
        "report", CONFIGS / "two_link.yaml", "--results", two_link_copy,
        "--set", "report.tracking={}", "--set", "report.formats=[svg]",
    )  # fmt: skip
    assert code == 0, err
    assert (two_link_copy / "report/figures/tracking.svg").exists()
    assert "What it is for" in (two_link_copy / "report/index.html").read_text()


def test_without_a_compiler_the_controller_is_interpreted(invoke, two_link_copy, monkeypatch):
    from paramreduce_cli.stages import tracking

    monkeypatch.setattr(tracking, "load", lambda *_: None)
    code, _, err = invoke(
        "report", CONFIGS / "two_link.yaml", "--results", two_link_copy, "--force",
        "--set", "report.tracking={moves: 1, control_period: 0.01}", "--set", "report.formats=[svg]",
    )  # fmt: skip
    assert code == 0, err
    assert (two_link_copy / "report/figures/tracking.svg").exists()


def test_loops_are_refused(invoke, tmp_path):
    code, _, err = invoke(
        "run", CONFIGS / "four_bar.yaml", "--results", tmp_path, "--set", "report.tracking={}",
        "--set", "trajectories.count=1", "--set", "trajectories.max_iterations=20",
    )  # fmt: skip
    assert code == 2
    assert "report.tracking is for open trees" in err.replace("\n", " ")
