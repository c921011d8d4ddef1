"""Exported code of mechanisms some of whose results are zero but for rounding passes its self-tests."""

import shutil
import subprocess
import sys

import numpy as np
import pytest
from loop_texts import PARALLELOGRAM, TURNTABLE, load_text

from paramreduce_cli.errors import FormulationError
from paramreduce_cli.export.code_generation import (
    Exported,
    make_exported_model,
    make_functions,
    make_random_cases,
)
from paramreduce_cli.export.code_verification import check
from paramreduce_cli.export.languages import languages
from paramreduce_cli.export.named_models import find_chosen_model
from paramreduce_cli.export.term_sizes import estimate_term_sizes, find_entry_sizes
from paramreduce_cli.records import Run
from paramreduce_cli.stages.build_model import build_model


def built(folder, text, **values):
    config = load_text(folder, text, **values)
    return build_model(config, config.model, Run())


def parallelogram(folder, kind="revolute", long=0.6, short=0.15):
    return built(folder, PARALLELOGRAM, kind=kind, long=long, short=short)


def turntable(folder, tilt=0.3):
    axis = [0.0, float(np.sin(tilt)), float(np.cos(tilt))]
    return built(folder, TURNTABLE, axis=axis, tilt=tilt)


CASES = {
    "hinge": parallelogram,
    "pin": lambda folder: parallelogram(folder, "planar"),
    "longer": lambda folder: parallelogram(folder, "revolute", 1.37, 0.31),
    "turntable": turntable,
    "tilted": lambda folder: turntable(folder, -1.1),
}


@pytest.mark.filterwarnings("ignore::paramreduce_cli.errors.ParamreduceWarning")
@pytest.mark.parametrize("kind", ["c", "python", "matlab"])
@pytest.mark.parametrize("name", CASES)
def test_self_tests_pass(name, kind, tmp_path):
    program = {"c": "gcc", "python": sys.executable, "matlab": "octave-cli"}[kind]
    if shutil.which(program) is None:
        pytest.skip(f"there is no {program}")
    model = CASES[name](tmp_path)
    chosen, title = find_chosen_model("full", model, None, None)
    files = languages[kind](make_exported_model(model, chosen, title=title, what=Exported.BOTH))
    for file, content in files.items():
        (tmp_path / file).write_bytes(content)
    stem = model.mechanism.robot
    command = {
        "c": f"gcc -O2 -o t {stem}.c {stem}_test.c -lm && ./t",
        "python": f"{sys.executable} {stem}_test.py",
        "matlab": f"octave-cli --quiet --no-window-system --eval {stem}_test",
    }[kind]
    done = subprocess.run(command, shell=True, cwd=tmp_path, capture_output=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_wrong_torque_is_found_beside_results_that_cancel(tmp_path):
    model = turntable(tmp_path)
    chosen, _ = find_chosen_model("full", model, None, None)
    functions = make_functions(model, chosen, Exported.IDM)
    stored = make_random_cases(model.mechanism, chosen, 20, np.random.default_rng(0))
    least = estimate_term_sizes(model.mechanism, chosen, stored)
    check(functions, stored, least)
    stored["tau"][3] += 1e-9 * np.abs(stored["tau"]).max()
    with pytest.raises(FormulationError, match="tau is off by"):
        check(functions, stored, least)


def test_joints_have_sizes_of_their_own():
    tau = np.array([[1e8, 1.0], [-2e8, 3.0]])
    np.testing.assert_array_equal(find_entry_sizes("tau", tau, 1e-3), [2e8, 3.0])
    np.testing.assert_array_equal(find_entry_sizes("tau", 0 * tau, 1e-3), [1e-3, 1e-3])
