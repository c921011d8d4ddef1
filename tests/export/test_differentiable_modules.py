"""Exported modules for JAX and PyTorch: values against the C, derivatives against exported ones and central differences."""

import ctypes
import importlib.util
import shutil
import subprocess
import sys

import numpy as np
import pytest
from conftest import model_of

from paramreduce_cli.export.code_generation import Exported, make_exported_model
from paramreduce_cli.export.languages import languages
from paramreduce_cli.reduction.models import make_base_model, make_full_model

LIBRARIES = ("jax", "torch")


class Jax:
    """What the tests ask of JAX."""

    def __init__(self):
        self.library = pytest.importorskip("jax", reason="JAX is not installed")
        self.library.config.update("jax_enable_x64", True)

    def array(self, values, single=False):
        return self.library.numpy.asarray(values, np.float32 if single else np.float64)

    def jacobian(self, function, argument):
        return self.library.jit(self.library.jacobian(function))(argument)

    def vmap(self, function):
        return self.library.jit(self.library.vmap(function))


class Torch:
    """What the tests ask of PyTorch."""

    def __init__(self):
        self.library = pytest.importorskip("torch", reason="PyTorch is not installed")

    def array(self, values, single=False):
        dtype = self.library.float32 if single else self.library.float64
        return self.library.as_tensor(values, dtype=dtype)

    def jacobian(self, function, argument):
        return self.library.func.jacrev(function)(argument)

    def vmap(self, function):
        return self.library.func.vmap(function)


@pytest.fixture(params=LIBRARIES)
def library(request):
    return {"jax": Jax, "torch": Torch}[request.param]()


def export(robot, kind, what, folder, chosen=make_full_model, **options):
    """Write a model, and return its loaded module (None if it is none) and the exported model."""
    model = model_of(robot)
    exported = make_exported_model(model, chosen(model), title="x", what=Exported(what), **options)
    for name, content in languages[kind](exported).items():
        (folder / name).write_bytes(content)
    path = folder / f"{robot}.py"
    if not path.exists():
        return None, exported
    spec = importlib.util.spec_from_file_location(f"{kind}_{what}_{robot}".replace("-", "_"), path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module, exported


def kind_of(library):
    return library.library.__name__


@pytest.mark.parametrize("kind", LIBRARIES)
@pytest.mark.parametrize(
    ("robot", "what"), [("two_link", "both"), ("four_bar", "idm"), ("cart_pole", "forward-dynamics")]
)  # fmt: skip
def test_modules_pass_their_self_test(kind, robot, what, tmp_path):
    pytest.importorskip(kind, reason="it is not installed")
    export(robot, kind, what, tmp_path)
    test = [sys.executable, f"{robot}_test.py"]
    done = subprocess.run(test, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "FAIL" not in done.stdout


def evaluate_c(folder, robot, phi, q, dq, ddq):
    """Torques of states by the exported C."""
    built = ["gcc", "-O1", "-shared", "-fPIC", "-o", "code.so", f"{robot}.c", "-lm"]
    subprocess.run(built, cwd=folder, check=True)
    function = ctypes.CDLL(str(folder / "code.so"))[f"{robot}_inverse_dynamics"]
    tau = np.empty_like(q)
    for k in range(len(q)):
        rows = (np.ascontiguousarray(row) for row in (phi, q[k], dq[k], ddq[k], tau[k]))
        function(*(row.ctypes.data_as(ctypes.c_void_p) for row in rows))
    return tau


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
def test_batches_have_the_torques_of_the_c(library, tmp_path):
    robot = "puma560"
    module, _ = export(robot, kind_of(library), "idm", tmp_path, make_base_model)
    export(robot, "c", "idm", tmp_path, make_base_model)
    rng = np.random.default_rng(0)
    q, dq, ddq = rng.uniform(-2, 2, (3, 50, 6))
    expected = evaluate_c(tmp_path, robot, np.array(module.PHI), q, dq, ddq)
    states = [library.array(x) for x in (q, dq, ddq)]
    got = np.asarray(module.inverse_dynamics(module.PHI, *states))
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    phi = library.array(np.tile(module.PHI, (50, 1)))
    mapped = library.vmap(module.inverse_dynamics)(phi, *states)
    np.testing.assert_allclose(mapped, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    # All axes before the last are those of states, and one state is for all if it has none.
    shaped = module.inverse_dynamics(module.PHI, states[0].reshape(5, 10, 6), states[1][0], states[2][0])  # fmt: skip
    assert tuple(shaped.shape) == (5, 10, 6)


def test_single_precision_stays_single(library, tmp_path):
    module, _ = export("puma560", kind_of(library), "both", tmp_path, make_base_model)
    rng = np.random.default_rng(0)
    double = [library.array(x) for x in rng.uniform(-2, 2, (3, 20, 6))]
    single = [library.array(x, single=True) for x in double]
    got = module.inverse_dynamics(module.PHI, *single)
    assert "float32" in str(got.dtype)
    one_state = module.direct_dynamics(module.PHI, single[0][0], single[1][0])
    assert all("float32" in str(part.dtype) for part in one_state)
    expected = np.asarray(module.inverse_dynamics(module.PHI, *double))
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-4 * np.abs(expected).max())


def test_derivatives_by_states_and_parameters(library, tmp_path):
    """The slopes by states are those that `--what derivatives` exports, by parameters the regressor."""
    kind, robot = kind_of(library), "puma560"
    module, _ = export(robot, kind, "idm", tmp_path, make_base_model)
    slopes, _ = export(robot, kind, "derivatives", tmp_path, make_base_model)
    regressor, _ = export(robot, kind, "regressor", tmp_path, make_base_model)
    rng = np.random.default_rng(1)
    q, dq, ddq = (library.array(x) for x in rng.uniform(-2, 2, (3, 6)))
    phi = library.array(module.PHI)
    by_q, by_dq = slopes.inverse_dynamics_derivatives(phi, q, dq, ddq)
    size = float(abs(by_q).max())
    got = library.jacobian(lambda x: module.inverse_dynamics(phi, x, dq, ddq), q)
    np.testing.assert_allclose(got, by_q, rtol=0, atol=1e-11 * size)
    got = library.jacobian(lambda x: module.inverse_dynamics(phi, q, x, ddq), dq)
    np.testing.assert_allclose(got, by_dq, rtol=0, atol=1e-11 * size)
    got = library.jacobian(lambda x: module.inverse_dynamics(x, q, dq, ddq), phi)
    K = regressor.regressor(q, dq, ddq)
    np.testing.assert_allclose(got, K, rtol=0, atol=1e-11 * float(abs(K).max()))


def test_closed_positions_have_the_slopes_of_the_velocity_problem(library, tmp_path):
    module, exported = export("four_bar", kind_of(library), "idm", tmp_path)
    z, guess = (library.array(exported.cases[name][0]) for name in ("z", "guess"))
    q = module.positions(z, guess)
    np.testing.assert_allclose(q, exported.cases["q"][0], rtol=0, atol=1e-11)
    slope = np.asarray(library.jacobian(lambda x: module.positions(x, guess), z))
    R, _ = module.velocities(q, library.array(np.zeros(exported.independent.size)))
    np.testing.assert_allclose(slope[list(exported.dependent)], R, rtol=0, atol=1e-9)
    step = 1e-5
    beside = [np.asarray(module.positions(z + s * step, guess)) for s in (1, -1)]
    np.testing.assert_allclose(slope[:, 0], (beside[0] - beside[1]) / (2 * step), atol=1e-6)


def test_loops_that_cannot_be_closed_give_nan(library, tmp_path):
    """A row of a batch that has no solution leaves the other rows alone."""
    module, exported = export("rssr", kind_of(library), "idm", tmp_path)
    z, guess = (np.array(exported.cases[name][:2]) for name in ("z", "guess"))
    guess[1] = np.nan
    q = np.asarray(module.positions(library.array(z), library.array(guess)))
    np.testing.assert_allclose(q[0], exported.cases["q"][0], rtol=0, atol=1e-10)
    assert np.isnan(q[1]).all()


def test_arrays_of_another_size_are_rejected(library, tmp_path):
    module, _ = export("two_link", kind_of(library), "idm", tmp_path)
    zero = library.array(np.zeros(2))
    with pytest.raises(ValueError, match=r"q has shape \(3,\); its last axes must be \(2,\)"):
        module.inverse_dynamics(module.PHI, library.array(np.zeros(3)), zero, zero)
    integers = module.inverse_dynamics(module.PHI, [0, 1], [0, 0], [1, 0])
    assert "float" in str(integers.dtype)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
def test_torch_compiles_the_function(tmp_path):
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    module, exported = export("two_link", "torch", "idm", tmp_path, constant=True)
    states = [torch.tensor(exported.cases[name]) for name in ("q", "dq", "ddq")]
    got = torch.compile(module.inverse_dynamics, fullgraph=True)(*states)
    np.testing.assert_allclose(got, exported.cases["tau"], atol=1e-12)
