"""Figures of a report, drawn here and in other processes."""

import pytest
from conftest import run_stages

from paramreduce_cli.report import figure_rendering
from paramreduce_cli.resources import processes

NAMES = [
    "torques",
    "identified-parameters",
    "poses",
    "log-motion",
    "log-spectra",
    "log-torques",
    "measured-torques",
    "terms",
]
"""Two that have something to draw here, and enough others for two processes."""


class StoppedError(Exception):
    """Of a report of which no more is wanted."""


@pytest.fixture
def data(two_link_copy, monkeypatch):
    """What the report of the small case shows."""
    kept = []

    def instead(names, data, formats, **how):
        kept.append(data)
        raise StoppedError

    with monkeypatch.context() as patched:
        patched.setattr(figure_rendering, "render_figures", instead)
        with pytest.raises(StoppedError):
            run_stages(two_link_copy, "report.title=Other")
    return kept[0]


def test_figures_do_not_depend_on_processes(data, monkeypatch):
    told = []

    def note(done, name):
        told.append(name)
        assert done == len(told)

    here = figure_rendering.render_figures(NAMES, data, ["png", "svg"], jobs=1, on_figure=note)
    assert told == NAMES
    assert list(here) == ["torques", "poses"]
    assert all(set(one) == {"png", "svg"} for one in here.values())
    told.clear()
    elsewhere = figure_rendering.render_figures(NAMES, data, ["png", "svg"], jobs=2, on_figure=note)
    assert sorted(told) == sorted(NAMES)
    assert list(elsewhere) == list(here)
    assert elsewhere == here
    monkeypatch.setattr(processes, "ProcessPoolExecutor", None)  # one format does not pay
    assert set(figure_rendering.render_figures(["poses"], data, ["svg"], jobs=2)["poses"]) == {
        "svg"
    }
