"""Computed-torque control on a pendulum whose answer is known, and in the report."""

import re
from functools import partial

import numpy as np
import pytest
from conftest import CONFIGS, TWO_LINK

from paramreduce_cli.errors import FormulationError
from paramreduce_cli.export import running
from paramreduce_cli.records import Paths, Tracking
from paramreduce_cli.report.tracking.control import advance_state, simulate
from paramreduce_cli.report.tracking.paths import plan_paths
from paramreduce_cli.stages import report

INERTIA, WEIGHT = 0.4, 3.0


def arm(z, dz, tau):
    return (tau - WEIGHT * np.cos(z)) / INERTIA


def followed(paths, share=1.0):
    def model(z, dz, ddz):
        return share * INERTIA * ddz + share * WEIGHT * np.cos(z)

    period = paths.time[1] - paths.time[0]
    return simulate(paths, model, partial(advance_state, arm, period), 20.0)


def path(period=1e-3, moves=3, seeds=range(1, 2)):
    one = np.ones(1)
    return plan_paths(-one, one, 2 * one, moves, period, seeds)


def test_paths_start_and_end_at_rest_and_keep_to_speeds():
    made = path(2.5e-4, seeds=range(3))
    assert np.all(np.abs(made.dz) <= 2 + 1e-9)
    assert np.all(np.abs(made.z) <= 1 + 1e-9)
    assert np.all(made.dz[0] == 0)
    step = made.time[1] - made.time[0]
    for k, n in enumerate(made.samples):
        z, dz, ddz = (x[:, k, 0] for x in (made.z, made.dz, made.ddz))
        rate = np.gradient(z[:n], step)
        np.testing.assert_allclose(rate[5:-5], dz[5 : n - 5], atol=step * np.abs(ddz).max())
        assert np.abs(np.diff(ddz[:n])).max() < 0.2 * np.abs(ddz).max()
        assert np.all(dz[n:] == 0)
        assert np.all(z[n:] == z[n - 1])


def test_a_path_does_not_depend_on_those_beside_it():
    alone, together = path(seeds=range(2, 3)), path(seeds=range(3))
    n = alone.samples[0]
    assert together.samples[2] == n
    np.testing.assert_array_equal(alone.z[:n, 0], together.z[:n, 2])
    one, many = (followed(paths, 0.9) for paths in (alone, together))
    np.testing.assert_allclose(one[:n, 0], many[:n, 2], rtol=1e-12, atol=1e-15)


def test_the_right_model_follows_as_well_as_its_period_allows():
    coarse, fine = (np.abs(followed(path(h))).max() for h in (4e-3, 1e-3))
    assert fine < 1e-4
    assert fine < 0.4 * coarse


def test_a_wrong_model_is_off_by_what_feedback_leaves():
    """At rest w^2 e INERTIA share = (1 - share) WEIGHT cos z."""
    still = np.zeros((3000, 1, 1))
    long = Paths(np.arange(3000) * 1e-3, np.array([3000]), still, still, still)
    errors = followed(long, 0.9)
    expected = 0.1 * WEIGHT / (0.9 * INERTIA * 20.0**2)
    assert errors[-1, 0, 0] == pytest.approx(expected, rel=1e-3)


def test_the_error_of_a_path_is_over_its_own_samples():
    paths = Paths(np.arange(4.0), np.array([2, 4]), *[np.zeros((4, 2, 1))] * 3)
    errors = np.ones((4, 2, 1))
    errors[2:, 0] = 100.0
    assert Tracking(paths, {"m": errors}).compute_rms("m").tolist() == [1.0, 1.0]


def test_the_report_shows_tracking_where_it_is_asked_for(invoke, two_link_copy):
    settings = ["report.tracking={}", "report.formats=[svg]"]
    invoke("report", TWO_LINK, "--results", two_link_copy, settings=settings)
    assert (two_link_copy / "report/figures/tracking.svg").exists()
    assert "Control with the reduced model" in (two_link_copy / "report/index.html").read_text()


def test_without_a_compiler_the_controller_is_interpreted(invoke, two_link_copy, monkeypatch):
    monkeypatch.setattr(running, "load", lambda *_: None)
    settings = ["report.tracking={moves: 1}", "report.formats=[svg]"]
    invoke("report", TWO_LINK, "--results", two_link_copy, "--force", settings=settings)
    assert (two_link_copy / "report/figures/tracking.svg").exists()


def test_every_arms_page_says_how_long_its_model_takes(two_link_results):
    page = (two_link_results / "report" / "index.html").read_text()
    assert re.search(r"\d ns instead of [\d.e+]+ ns in (C|Python)", page)


def test_pages_of_loops_say_what_is_timed(invoke, tmp_path):
    few = ["trajectories.count=1", "trajectories.test_count=1", "trajectories.max_iterations=20", "report.formats=[svg]",
           "reduction.heuristics=[forward-selection]", "validation.accept={}",
           "validation.stability=false"]  # fmt: skip
    invoke("run", CONFIGS / "four_bar.yaml", "--results", tmp_path, settings=few)
    page = (tmp_path / "report" / "index.html").read_text()
    assert re.search(
        r"d_z with R handed in: [\d.e+]+ ns instead of [\d.e+]+ ns in (C|Python)", page
    )


def test_a_model_in_doubt_is_not_timed(invoke, two_link_copy, monkeypatch):
    def failing(*_):
        raise FormulationError("two formulations disagree")

    monkeypatch.setattr(report, "compile_model", failing)
    made = invoke(
        "report", TWO_LINK, "--results", two_link_copy, "--force", settings=["report.formats=[svg]"]
    )
    assert "nothing is timed: two formulations disagree" in made.err.replace("\n", " ")
    assert " ns instead of" not in (two_link_copy / "report" / "index.html").read_text()


def test_loops_are_refused(invoke, tmp_path):
    settings = [
        "report.tracking={}",
        "trajectories.count=1",
        "trajectories.test_count=1",
        "trajectories.max_iterations=20",
    ]
    run = ("run", CONFIGS / "four_bar.yaml", "--results", tmp_path)
    refused = invoke(*run, settings=settings, code=2)
    assert "works for open trees only" in refused.err.replace("\n", " ")
