"""Mechanisms and finished runs that several tests look at."""

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from paramreduce_cli.artifacts.store import Store
from paramreduce_cli.cli import main
from paramreduce_cli.config import load_config
from paramreduce_cli.pipeline import stages_to_run
from paramreduce_cli.robots.dh import DHRow, mechanism_from_dh
from paramreduce_cli.runner import Runner

ROOT = Path(__file__).resolve().parents[1]
CONFIGS = ROOT / "configs"

CLOSED_LOOPS = ["four_bar", "five_bar", "rssr", "hexaglide"]

PI = np.pi
PUMA_ROWS = [
    (0, 0, 0), (0, -PI / 2, 0), (0.4318, 0, -0.1491),
    (-0.0203, PI / 2, -0.4318), (0, -PI / 2, 0), (0, PI / 2, 0),
]  # fmt: skip


def puma_mechanism():
    rows = [
        DHRow(str(k + 1), str(k) if k else None, "revolute", a, alpha, d, 0.0)
        for k, (a, alpha, d) in enumerate(PUMA_ROWS)
    ]
    return mechanism_from_dh("puma560", rows, "modified", [0, 0, -9.81])


def standard_arm():
    """Standard DH with offsets, a prismatic joint and nothing at right angles."""
    rows = [
        DHRow("one", None, "revolute", 0.1, 0.7, 0.3, 0.4),
        DHRow("two", "one", "prismatic", 0.2, -0.4, 0.15, 0.9),
        DHRow("three", "two", "revolute", 0.25, 1.1, -0.2, PI / 2),
        DHRow("four", "three", "revolute", -0.1, 0.3, 0.05, 0.0),
    ]
    return mechanism_from_dh("standard_arm", rows, "standard", [1.0, -2.0, -9.0])


def branching_tree():
    """A prismatic-revolute tree with two branches on one body, gravity askew."""
    rows = [
        DHRow("slide", None, "prismatic", 0.0, 0.3, 0.2, 0.5),
        DHRow("left", "slide", "revolute", 0.4, -PI / 2, 0.1, 0.0, 0.6, 0.2),
        DHRow("right", "slide", "revolute", 0.3, 0.8, -0.1, 0.2, -0.9, -0.1),
        DHRow("tip", "right", "prismatic", 0.2, PI / 2, 0.0, 0.0),
        DHRow("wrist", "tip", "revolute", 0.0, -1.0, 0.3, 0.0),
    ]
    return mechanism_from_dh("tree", rows, "modified", [0.5, 1.5, -9.3])


MECHANISMS = {"puma": puma_mechanism, "standard": standard_arm, "tree": branching_tree}


@pytest.fixture(params=list(MECHANISMS))
def mechanism(request):
    return MECHANISMS[request.param]()


def random_states(mechanism, count, seed=0):
    rng = np.random.default_rng(seed)
    return tuple(rng.uniform(-2, 2, size=(count, mechanism.n_dof)) for _ in range(3))


@pytest.fixture(scope="session")
def two_link_results(tmp_path_factory):
    """A finished run of the small case; look, do not touch."""
    folder = tmp_path_factory.mktemp("two_link")
    config = load_config(CONFIGS / "two_link.yaml")
    runner = Runner(config, Store(folder), jobs=2)
    for stage in stages_to_run(config):
        runner.run(stage)
    return folder


@pytest.fixture
def two_link_copy(two_link_results, tmp_path):
    """A finished run to do things to."""
    copy = tmp_path / "results"
    shutil.copytree(two_link_results, copy)
    return copy


@pytest.fixture
def invoke(monkeypatch, capsys):
    """Call the command line; returns (exit code, standard output, standard error)."""

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["paramreduce", *map(str, arguments)])
        with pytest.raises(SystemExit) as stopped:
            main()
        captured = capsys.readouterr()
        return stopped.value.code, captured.out, captured.err

    return call


@pytest.fixture
def write_config(tmp_path):
    """Write a variant of the small case's config; returns its path."""

    def write(*replacements, name="two_link.yaml"):
        text = (CONFIGS / "two_link.yaml").read_text()
        for old, new in replacements:
            assert old in text, old
            text = text.replace(old, new)
        path = tmp_path / name
        path.write_text(text)
        return path

    return write
