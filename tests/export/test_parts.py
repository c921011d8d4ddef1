"""Parts of the dynamics: gravity, Coriolis torques, bias and mass matrix, against Pinocchio and in their languages."""

import dataclasses
import shutil
import subprocess

import numpy as np
import pinocchio as pin
import pytest
from conftest import model_of
from oracles import pinocchio_model

from paramreduce_cli.errors import DataError
from paramreduce_cli.export.code_generation import Exported, make_exported_model
from paramreduce_cli.export.languages import languages
from paramreduce_cli.reduction.models import make_base_model, make_full_model

PARTS = [Exported.GRAVITY, Exported.CORIOLIS, Exported.NONLINEAR, Exported.MASS_MATRIX]


def evaluate(model, what, q, dq, **options):
    """Result of the exported function for some states of an open tree, (n_states, ...)."""
    chosen = make_full_model(model)
    exported = make_exported_model(model, chosen, title="parts", what=what, **options)
    (function,) = exported.functions
    given = {"phi": np.tile(chosen.values, (len(q), 1)), "q": q, "dq": dq}
    inputs = [column for a in function.arguments for column in given[a.name].T]
    columns = [np.broadcast_to(x, len(q)) for x in function.program.evaluate(inputs)]
    return np.column_stack(columns).reshape(-1, *function.results[0].shape)


@pytest.mark.parametrize("constant", [False, True])
@pytest.mark.parametrize("robot", ["puma560", "ur5e"])
def test_parts_are_those_of_pinocchio(robot, constant):
    model = model_of(robot)
    inertial = [p.kind.key == "" for p in model.mechanism.parameters]
    assert all(inertial) or robot != "puma560"
    rng = np.random.default_rng(2)
    q, dq = rng.uniform(-2, 2, (2, 30, model.mechanism.n_q))
    built, data, offsets = pinocchio_model.build(model.mechanism, model.values)
    expected = {what: [] for what in PARTS}
    for z, dz in zip(q + offsets, dq, strict=True):
        g = pin.computeGeneralizedGravity(built, data, z).copy()
        bias = pin.nonLinearEffects(built, data, z, dz).copy()
        M = pin.crba(built, data, z).copy()
        M = np.triu(M) + np.triu(M, 1).T
        for what, value in zip(PARTS, (g, bias - g, bias, M), strict=True):
            expected[what].append(value)
    friction = np.where(inertial, 0.0, model.values)
    drives = bool(friction.any())
    for what in PARTS:
        if drives and what is Exported.NONLINEAR:
            continue  # with friction, which Pinocchio's model leaves out
        got = evaluate(model, what, q, dq, constant=constant)
        size = np.abs(expected[what]).max()
        np.testing.assert_allclose(got, expected[what], rtol=0, atol=1e-11 * size)


def test_parts_add_up_with_friction_and_loops():
    """The bias is what rest, Coriolis torques and friction make of it; friction alone is odd in the velocities."""
    model = model_of("quarter_car")
    parts = {}
    for what in PARTS[:3]:
        exported = make_exported_model(model, make_full_model(model), title="parts", what=what)
        parts[what] = exported.cases[exported.functions[0].results[0].name]
    viscous = parts[Exported.NONLINEAR] - parts[Exported.GRAVITY] - parts[Exported.CORIOLIS]
    assert np.abs(viscous).max() > 1
    dq = exported.cases["dq"]
    power = np.einsum("ki,ki->k", viscous, dq[:, list(model.mechanism.independent)])
    assert (power > 0).all()  # dampers take power


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
@pytest.mark.parametrize("robot", ["two_link", "four_bar", "cart_pole"])
@pytest.mark.parametrize("what", [*PARTS, Exported.FORWARD_DYNAMICS])
def test_parts_pass_their_self_test_in_c_and_python(robot, what, tmp_path):
    model = model_of(robot)
    chosen = make_base_model(model)
    exported = make_exported_model(model, chosen, title="parts", what=what)
    for kind in ("c", "python"):
        for name, content in languages[kind](exported).items():
            (tmp_path / name).write_bytes(content)
    subprocess.run(["make", "test"], cwd=tmp_path, check=True, capture_output=True)
    (test,) = tmp_path.glob("*_test.py")
    done = subprocess.run(["python3", test.name], cwd=tmp_path, check=False, capture_output=True)
    assert done.returncode == 0, done.stderr


def test_parts_cost_less_than_the_whole():
    model = model_of("puma560")
    counts = {}
    for what in (*PARTS, Exported.BOTH):
        exported = make_exported_model(model, make_base_model(model), title="parts", what=what)
        counts[what] = [function.program.n_operations for function in exported.functions]
    inverse, direct = counts[Exported.BOTH]
    assert counts[Exported.GRAVITY][0] < inverse / 4
    assert counts[Exported.MASS_MATRIX][0] < direct / 2
    assert counts[Exported.CORIOLIS][0] < counts[Exported.NONLINEAR][0] < inverse


def test_derivatives_are_those_of_pinocchio():
    model = model_of("puma560")
    chosen = make_full_model(model)
    rng = np.random.default_rng(4)
    q, dq, ddq = rng.uniform(-2, 2, (3, 20, model.mechanism.n_q))
    exported = make_exported_model(model, chosen, title="parts", what=Exported.DERIVATIVES)
    (function,) = exported.functions
    given = {"phi": np.tile(chosen.values, (len(q), 1)), "q": q, "dq": dq, "ddq": ddq}
    inputs = [column for a in function.arguments for column in given[a.name].T]
    values = np.column_stack(
        [np.broadcast_to(x, len(q)) for x in function.program.evaluate(inputs)]
    )
    found = values.reshape(len(q), 2, 6, 6)
    built, data, offsets = pinocchio_model.build(model.mechanism, model.values)
    for k in range(len(q)):
        pin.computeRNEADerivatives(built, data, q[k] + offsets, dq[k], ddq[k])
        for got, expected in ((found[k, 0], data.dtau_dq), (found[k, 1], data.dtau_dv)):
            np.testing.assert_allclose(got, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


def test_the_coriolis_matrix_is_skew_to_the_rate_of_the_mass_matrix():
    model = model_of("puma560")
    rng = np.random.default_rng(5)
    q, dq = rng.uniform(-2, 2, (2, 10, 6))
    C = evaluate(model, Exported.CORIOLIS_MATRIX, q, dq)
    step = 1e-6
    ends = [evaluate(model, Exported.MASS_MATRIX, q + sign * step * dq, 0 * dq) for sign in (1, -1)]
    rate = (ends[0] - ends[1]) / (2 * step)
    skew = rate - 2 * C
    assert np.abs(skew + skew.transpose(0, 2, 1)).max() < 1e-6 * np.abs(C).max()
    torque = np.einsum("kij,kj->ki", C, dq)
    np.testing.assert_allclose(torque, evaluate(model, Exported.CORIOLIS, q, dq), atol=1e-10)


@pytest.mark.parametrize("robot", ["puma560", "four_bar", "cart_pole"])
def test_forward_dynamics_undo_the_inverse(robot):
    """The stored accelerations are those of the motion; the torques follow from them by textbook recursion."""
    model = model_of(robot)
    chosen = make_full_model(model)
    exported = make_exported_model(model, chosen, title="parts", what=Exported.FORWARD_DYNAMICS)
    (function,) = exported.functions
    cases = exported.cases
    count = len(cases["tau"])
    inputs = [x for a in function.arguments for x in cases[a.name].reshape(count, -1).T]
    got = np.column_stack([np.broadcast_to(x, count) for x in function.program.evaluate(inputs)])
    expected = cases[function.results[0].name]
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("robot", ["puma560", "ur5e"])
def test_momentum_and_its_rate_are_those_of_pinocchio(robot):
    model = model_of(robot)
    friction = [p.kind.key != "" for p in model.mechanism.parameters]
    model = dataclasses.replace(model, values=np.where(friction, 0.0, model.values))
    chosen = make_full_model(model)
    exported = make_exported_model(model, chosen, title="parts", what=Exported.MOMENTUM)
    (function,) = exported.functions
    n = model.mechanism.n_q
    q, dq = np.random.default_rng(6).uniform(-2, 2, (2, 20, n))
    given = {"phi": np.tile(chosen.values, (len(q), 1)), "q": q, "dq": dq}
    inputs = [column for a in function.arguments for column in given[a.name].T]
    columns = [np.broadcast_to(x, len(q)) for x in function.program.evaluate(inputs)]
    found = np.column_stack(columns)
    built, data, offsets = pinocchio_model.build(model.mechanism, model.values)
    for k in range(len(q)):
        M = pin.crba(built, data, q[k] + offsets)
        M = np.triu(M) + np.triu(M, 1).T
        p = M @ dq[k]
        C = pin.computeCoriolisMatrix(built, data, q[k] + offsets, dq[k])
        rate = C.T @ dq[k] - pin.computeGeneralizedGravity(built, data, q[k] + offsets)
        np.testing.assert_allclose(found[k, :n], p, rtol=0, atol=1e-11 * np.abs(p).max())
        np.testing.assert_allclose(found[k, n:], rate, rtol=0, atol=1e-11 * np.abs(rate).max())


def test_momentum_costs_less_than_its_parts():
    model = model_of("puma560")
    counts = {}
    for what in (Exported.MOMENTUM, Exported.MASS_MATRIX, Exported.CORIOLIS_MATRIX):
        exported = make_exported_model(model, make_base_model(model), title="parts", what=what)
        counts[what] = exported.functions[0].program.n_operations
    assert counts.pop(Exported.MOMENTUM) < sum(counts.values()) / 2


def test_loops_have_no_derivatives():
    model = model_of("four_bar")
    for what in (Exported.DERIVATIVES, Exported.CORIOLIS_MATRIX):
        with pytest.raises(DataError, match="needs an open tree"):
            make_exported_model(model, make_full_model(model), title="parts", what=what)
