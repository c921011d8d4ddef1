"""Mechanisms and finished runs that several tests look at."""

import json
import os
import pickle
import shutil
import sys
from functools import cache
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # as the command line does, before NumPy is loaded

import filelock
import numpy as np
import pytest
from shortcuts import Wanted, drawn_figures, searched_formulations
from simulated_logs import log_config, two_link_log, write_log

from paramreduce_cli.artifacts.store import Store
from paramreduce_cli.cli import main
from paramreduce_cli.config import load_config
from paramreduce_cli.lean import formulations as formulations_module
from paramreduce_cli.records import ReducedModel, Run
from paramreduce_cli.robots import Robot
from paramreduce_cli.running.pipeline import list_stages_to_run
from paramreduce_cli.running.runner import Runner
from paramreduce_cli.stages.build_model import build_model

ROOT = Path(__file__).resolve().parents[1]
CONFIGS = ROOT / "configs"
TWO_LINK = CONFIGS / "two_link.yaml"

CLOSED_LOOPS = ["four_bar", "five_bar", "rssr", "delta", "humanoid_leg", "hexaglide"]

PI = np.pi
PUMA_ROWS = [
    (0, 0, 0), (0, -PI / 2, 0), (0.4318, 0, -0.1491),
    (-0.0203, PI / 2, -0.4318), (0, -PI / 2, 0), (0, PI / 2, 0),
]  # fmt: skip


def mechanism_of(description, gravity=(0, 0, -9.81), robot="arm", **more):
    """The mechanism of a description, without values of the bodies' parameters."""
    description = {**description, "gravity": [float(g) for g in gravity]}
    sections = {"description": description, "parameter_sets": {"none": {}}, **more}
    return Robot(robot=robot, **sections).build_mechanism()


def dh(rows, convention="modified"):
    """A Denavit-Hartenberg description of (name, parent, type, a, alpha, d, theta, gamma, b)."""
    keys = ("name", "parent", "type", "a", "alpha", "d", "theta", "gamma", "b")
    joints = [dict(zip(keys, row, strict=False)) for row in rows]
    return {"dh": {"convention": convention, "joints": joints}}


def puma_mechanism():
    rows = [
        (str(k + 1), str(k) if k else None, "revolute", a, alpha, d)
        for k, (a, alpha, d) in enumerate(PUMA_ROWS)
    ]
    return mechanism_of(dh(rows), robot="puma560")


def standard_arm():
    """Standard DH with offsets, a prismatic joint and nothing at right angles."""
    rows = [
        ("one", None, "revolute", 0.1, 0.7, 0.3, 0.4),
        ("two", "one", "prismatic", 0.2, -0.4, 0.15, 0.9),
        ("three", "two", "revolute", 0.25, 1.1, -0.2, PI / 2),
        ("four", "three", "revolute", -0.1, 0.3, 0.05, 0.0),
    ]
    return mechanism_of(dh(rows, "standard"), [1.0, -2.0, -9.0])


def branching_tree():
    """A prismatic-revolute tree with two branches on one body, gravity askew."""
    rows = [
        ("slide", None, "prismatic", 0.0, 0.3, 0.2, 0.5),
        ("left", "slide", "revolute", 0.4, -PI / 2, 0.1, 0.0, 0.6, 0.2),
        ("right", "slide", "revolute", 0.3, 0.8, -0.1, 0.2, -0.9, -0.1),
        ("tip", "right", "prismatic", 0.2, PI / 2, 0.0, 0.0),
        ("wrist", "tip", "revolute", 0.0, -1.0, 0.3, 0.0),
    ]
    return mechanism_of(dh(rows), [0.5, 1.5, -9.3])


def config_of(robot, *overrides):
    """One of the configs that ship."""
    return load_config(CONFIGS / f"{robot}.yaml", overrides)


def model_of(robot, *overrides):
    """The model of one of the configs that ship."""
    return config_and_model(robot, *overrides)[1]


def config_and_model(robot, *overrides):
    """The config and the model of a robot that ships; look, do not touch."""
    return _config_and_model(robot, overrides, Wanted.formulations)


@cache
def _config_and_model(robot, overrides, searched):
    config = config_of(robot, *overrides)
    return config, build_model(config, config.model, Run())


def summary_of(folder):
    return json.loads((folder / "report" / "summary.json").read_text())


def whole(mechanism, kept, values=None):
    """The model that keeps some standard parameters, a value each."""
    kept = np.asarray(kept, dtype=int)
    position = np.full(mechanism.n_parameters, -1)
    position[kept] = np.arange(kept.size)
    names = tuple(mechanism.parameter_names[k] for k in kept)
    values = np.ones(kept.size) if values is None else np.asarray(values)
    return ReducedModel(names, values, position, names)


MECHANISMS = {"puma": puma_mechanism, "standard": standard_arm, "tree": branching_tree}


@pytest.fixture(params=list(MECHANISMS))
def mechanism(request):
    return MECHANISMS[request.param]()


def random_states(mechanism, count, seed=0):
    rng = np.random.default_rng(seed)
    return tuple(rng.uniform(-2, 2, size=(count, mechanism.n_dof)) for _ in range(3))


ONE_FORMAT = "report.formats=[svg]"
"""The format that is the default, for runs whose settings must not change with it."""


NO_PICTURE = b'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1 1"/>'


@pytest.fixture(autouse=True)
def figures_not_drawn(request, monkeypatch):
    """Drawing figures takes most of a small run; tests of the report draw them, and those marked with ``draws``."""
    if "report" in request.path.parts or request.node.get_closest_marker("draws"):
        return
    from paramreduce_cli.report import figure_rendering

    draw = figure_rendering.render_figures

    def rendered(names, data, formats, **how):
        if Wanted.figures:
            return draw(names, data, formats, **how)
        return {name: dict.fromkeys(formats, NO_PICTURE) for name in names}

    monkeypatch.setattr(figure_rendering, "render_figures", rendered)


ROUGH_TERMS = ("terms.functions=[inverse]", "terms.torque_error=0.5", "terms.rounds=0")


def run_stages(folder, *overrides):
    """Run the small case; returns which stages had nothing to do."""
    config = config_of("two_link", ONE_FORMAT, *overrides)
    runner = Runner(config, Store(folder))
    return {stage.name: runner.run(stage).current for stage in list_stages_to_run(config)}


def slope(function, arguments, direction, which=0, step=1e-6):
    """The derivative of a function along a direction of one argument, by central differences."""
    ahead, behind = list(arguments), list(arguments)
    ahead[which] = ahead[which] + step * direction
    behind[which] = behind[which] - step * direction
    return (function(*ahead) - function(*behind)) / (2 * step)


@pytest.fixture(autouse=True)
def one_core(monkeypatch):
    """Tests run in as many processes as there are cores already; those of worker processes ask for them."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0}, raising=False)


@pytest.fixture(scope="session")
def made_once(tmp_path_factory):
    """Call ``make_once(name, make)`` for a folder that one process of the session fills with ``make(folder)``.

    Look at what is in it, do not touch.
    """
    root = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        root = root.parent

    def make_once(name, make):
        folder = root / f"made-{name}"
        done = root / f"made-{name}.done"
        with filelock.FileLock(f"{folder}.lock"):
            if not done.exists():
                shutil.rmtree(folder, ignore_errors=True)
                folder.mkdir()
                make(folder)
                done.touch()
        return folder

    return make_once


@pytest.fixture(scope="session", autouse=True)
def formulations_as_searches_begin():
    """Take the formulations that searches begin with: correct ones, though not the leanest, in a tenth of the time.

    Tests of the leanest ones ask for ``searched_formulations``.
    """
    search = formulations_module._run_chain

    def best(mechanism, asked):
        if Wanted.formulations:
            return search(mechanism, asked)
        return [tuple(asked.start) for _ in asked.dropped]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(formulations_module, "_run_chain", best)
        yield


@pytest.fixture(scope="session")
def puma(made_once):
    return _leanest_model_of("puma560", made_once)


@pytest.fixture(scope="session")
def hexaglide(made_once):
    return _leanest_model_of("hexaglide", made_once)


def _leanest_model_of(robot, made_once):
    """The model of a robot with the leanest formulations, which are searched once a session."""

    def make(folder):
        config = config_of(robot)
        with searched_formulations():
            made = build_model(config, config.model, Run())
        (folder / "model").write_bytes(pickle.dumps(made))

    return pickle.loads((made_once(f"leanest-{robot}", make) / "model").read_bytes())


@pytest.fixture(scope="session")
def two_link_results(made_once):
    """A finished run of the small case; look, do not touch."""
    with drawn_figures():
        return made_once("two_link", run_stages)


@pytest.fixture(scope="session")
def measured_results(made_once):
    """A finished run of the small case on a log; look, do not touch."""

    def make(folder):
        write_log(folder / "log.csv", two_link_log())
        config = load_config(log_config(folder), [ONE_FORMAT, *ROUGH_TERMS])
        for stage in list_stages_to_run(config):
            Runner(config, Store(folder / "results")).run(stage)

    with drawn_figures():
        return made_once("measured", make)


@pytest.fixture
def measured_copy(measured_results, tmp_path):
    """A finished run on a log to do things to."""
    copy = tmp_path / "measured"
    shutil.copytree(measured_results, copy)
    return copy


@pytest.fixture
def summary(two_link_results):
    return summary_of(two_link_results)


@pytest.fixture
def two_link_copy(two_link_results, tmp_path):
    """A finished run to do things to."""
    copy = tmp_path / "results"
    shutil.copytree(two_link_results, copy)
    return copy


@pytest.fixture
def invoke(monkeypatch, capsys):
    """Call the command line with settings; returns what it prints if the exit code is right."""

    def call(*arguments, settings=(), code=0):
        changes = [part for setting in settings for part in ("--set", setting)]
        monkeypatch.setattr(sys, "argv", ["paramreduce", *map(str, [*arguments, *changes])])
        with pytest.raises(SystemExit) as stopped:
            main()
        captured = capsys.readouterr()
        assert stopped.value.code == code, captured
        return captured

    return call


@pytest.fixture
def write_config(tmp_path):
    """Write a variant of a config that ships, the small case's; returns its path."""

    def write(*replacements, robot="two_link"):
        text = (CONFIGS / f"{robot}.yaml").read_text()
        for old, new in replacements:
            assert old in text, old
            text = text.replace(old, new)
        path = tmp_path / f"{robot}.yaml"
        path.write_text(text)
        return path

    return write
