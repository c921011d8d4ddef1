"""The PUMA with published rotors and friction: selection by definition, and what its code computes."""

import shutil
import subprocess

import numpy as np
import pytest
from conftest import config_and_model
from conftest import random_states as states_of
from oracles import pinocchio_model
from oracles.selection import all_best_errors, error_by_definition
from selecting import problem, subsets

from paramreduce_cli.export.code_generation import make_exported_model
from paramreduce_cli.export.languages import languages
from paramreduce_cli.export.named_models import find_chosen_model
from paramreduce_cli.multibody.dynamics import Dynamics


@pytest.fixture(scope="module")
def puma():
    return config_and_model("puma560_friction")


@pytest.fixture(scope="module")
def data(puma):
    """W and torques of random states, rows divided by nominal torques."""
    _, model = puma
    K = Dynamics(model.mechanism).compute_regressor(*states_of(model.mechanism, 40))
    weights = model.nominal_torque[:, None]
    W = (K / weights).reshape(-1, K.shape[2])
    return W[:, model.affecting], W @ model.values


def by_definition(puma, states):
    """Rigid bodies by Pinocchio; rotors and friction on the motors' side by hand."""
    config, model = puma
    z, dz, ddz = states
    tau = pinocchio_model.inverse_dynamics(model.mechanism, model.values, z, dz, ddz)
    for k, drive in enumerate(config.drives.values()):
        (ratio,) = drive.motion.values()
        speed, acceleration = ratio * dz[:, k], ratio * ddz[:, k]
        motor = drive.inertia * acceleration + drive.viscous * speed
        motor += drive.coulomb * np.sign(speed) + drive.offset
        tau[:, k] += ratio * motor
    return tau


def test_torques(puma):
    _, model = puma
    states = states_of(model.mechanism, 50)
    found = Dynamics(model.mechanism).compute_torques(*states, model.values)
    assert found == pytest.approx(by_definition(puma, states), rel=1e-11, abs=1e-10)


def test_forward_selection(data):
    W, chi = data
    found = subsets("forward-selection", problem(W, chi))
    for n in range(1, 25):
        *before, last = found[n]
        rest = [k for k in range(W.shape[1]) if k not in before]
        errors = [error_by_definition(W, chi, [*before, k]) for k in rest]
        assert error_by_definition(W, chi, [*before, last]) <= min(errors) * (1 + 1e-9)


def test_best_subsets(data):
    """Among the thirteen columns that Forward Selection takes first."""
    W, chi = data
    first = subsets("forward-selection", problem(W, chi))[13]
    expected = all_best_errors(W[:, first], chi)
    found = subsets("best-subset", problem(W[:, first], chi))
    for n, kept in found.items():
        assert error_by_definition(W[:, first], chi, kept) == pytest.approx(expected[n], rel=1e-9)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
def test_c_code(puma, tmp_path):
    _, model = puma
    chosen, _ = find_chosen_model("full", model, None, None)
    for name, content in languages["c"](make_exported_model(model, chosen, title="full")).items():
        (tmp_path / name).write_bytes(content)
    z, dz, ddz = states_of(model.mechanism, 20)
    rows = np.hstack([z, dz, ddz])
    (tmp_path / "main.c").write_text(
        '#include "puma560_friction.h"\n#include <stdio.h>\nint main(void) {\n'
        "  double phi[puma560_friction_n_parameters], x[18], tau[6];\n"
        "  puma560_friction_parameters(phi);\n"
        "  for (;;) {\n"
        '    for (int i = 0; i < 18; ++i) if (scanf("%lf", x + i) != 1) return 0;\n'
        "    puma560_friction_inverse_dynamics(phi, x, x + 6, x + 12, tau);\n"
        '    for (int i = 0; i < 6; ++i) printf("%.17g\\n", tau[i]);\n  }\n}\n'
    )
    sources = ["main.c", "puma560_friction.c"]
    subprocess.run(["gcc", "-O2", "-o", "t", *sources, "-lm"], cwd=tmp_path, check=True)
    text = "\n".join(repr(float(x)) for x in rows.ravel())
    done = subprocess.run(
        ["./t"], cwd=tmp_path, input=text, capture_output=True, text=True, check=True
    )
    found = np.array(done.stdout.split(), dtype=float).reshape(-1, 6)
    assert found == pytest.approx(by_definition(puma, (z, dz, ddz)), rel=1e-10, abs=1e-9)
