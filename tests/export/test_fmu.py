"""Exported units of FMI 3.0, run by FMPy: against Pinocchio's accelerations, stored results and the balance of energy."""

import dataclasses
import shutil
import subprocess
import zipfile

import numpy as np
import pinocchio as pin
import pytest
from conftest import model_of
from oracles import pinocchio_model
from oracles.lagrange import Lagrange
from scipy.integrate import solve_ivp

from paramreduce_cli.errors import DataError, ParamreduceWarning
from paramreduce_cli.export.code_generation import Exported, adapt_kinds, make_exported_model
from paramreduce_cli.export.languages import fmu as units
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.reduction.models import make_full_model

fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed")
from fmpy.fmi1 import FMICallException  # noqa: E402
from fmpy.fmi3 import FMU3Slave  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402

needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")


def write_units(folder, robot, what=Exported.BOTH, **options):
    """Write the units of a model, and return the exported model."""
    model = model_of(robot)
    kinds = adapt_kinds(what, "fmu")
    exported = make_exported_model(model, make_full_model(model), title="x", what=kinds, **options)
    for name, content in units.fmu(exported).items():
        (folder / name).write_bytes(content)
    return exported


class Slave:
    """An initialised co-simulation of a unit."""

    def __init__(self, path, **starts):
        description = fmpy.read_model_description(str(path))
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.shapes = {v.name: v.shape or () for v in description.modelVariables}
        self.unit = FMU3Slave(
            guid=description.guid, unzipDirectory=fmpy.extract(str(path)), instanceName="x",
            modelIdentifier=description.coSimulation.modelIdentifier,
        )  # fmt: skip
        self.unit.instantiate()
        self.unit.enterInitializationMode()
        for name, values in starts.items():
            self.set(name, values)
        self.unit.exitInitializationMode()

    def set(self, name, values):
        self.unit.setFloat64([self.references[name]], np.ravel(values).tolist())

    def get(self, name):
        size = int(np.prod(self.shapes[name]))
        return np.reshape(self.unit.getFloat64([self.references[name]], nValues=size), self.shapes[name])  # fmt: skip


@needs_gcc
@pytest.mark.parametrize("robot", ["two_link", "four_bar", "cart_pole"])
def test_units_keep_to_the_standard(tmp_path, robot):
    """FMPy validates the descriptions; gcc compares the declarations with those of the standard's headers."""
    write_units(tmp_path, robot)
    assert len(list(tmp_path.glob("*.fmu"))) == 2
    headers = f"{fmpy.__path__[0]}/c-code"
    for path in tmp_path.glob("*.fmu"):
        assert validate_fmu(str(path)) == []
        with zipfile.ZipFile(path) as archive:
            archive.extractall(tmp_path / path.stem)
        source = next((tmp_path / path.stem / "sources").glob("*.c"))
        flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-Wno-strict-prototypes", "-fsyntax-only"]  # fmt: skip
        for more in (["-DFMI3_HEADERS", f"-I{headers}"], []):
            subprocess.run(["gcc", *flags, *more, source], check=True)


@needs_gcc
def test_a_simulation_follows_the_accelerations_of_pinocchio(tmp_path):
    robot = "puma560"
    model = model_of(robot)
    write_units(tmp_path, robot, Exported.FORWARD_DYNAMICS)
    built, data, offsets = pinocchio_model.build(model.mechanism, model.values)
    tau, q = np.array([5.0, -3, 2, 0.1, -0.2, 0.05]), np.array([0.1, -1.2, 0.4, 0.3, -0.5, 0.2])

    def slope(_, x):
        return np.hstack([x[6:], pin.aba(built, data, x[:6] + offsets, x[6:], tau)])

    expected = solve_ivp(slope, (0, 0.2), np.hstack([q, np.zeros(6)]), rtol=1e-11, atol=1e-12).y[:, -1]  # fmt: skip
    slave = Slave(tmp_path / f"{robot}_forward_dynamics.fmu", q=q, tau=tau)
    for k in range(20):
        slave.unit.doStep(0.01 * k, 0.01)
    np.testing.assert_allclose(slave.get("q"), expected[:6], atol=1e-8)
    np.testing.assert_allclose(slave.get("dq"), expected[6:], atol=1e-7)
    result = fmpy.simulate_fmu(
        str(tmp_path / f"{robot}_forward_dynamics.fmu"), stop_time=0.2, output_interval=0.01,
        fmi_type="ModelExchange", relative_tolerance=1e-10,
        start_values={"q": q.tolist(), "tau": tau.tolist()},
    )  # fmt: skip
    np.testing.assert_allclose(result["q"][-1], expected[:6], atol=1e-6)


@needs_gcc
def test_a_swinging_loop_keeps_its_energy(tmp_path):
    """A four-bar without friction and torques exchanges kinetic and potential energy, which Lagrange's oracle adds up."""
    write_units(tmp_path, "four_bar")
    mechanism, values = (model := model_of("four_bar")).mechanism, model.values
    oracle, coordinates = Lagrange(mechanism), Coordinates(mechanism, once=True)
    slave = Slave(tmp_path / "four_bar_forward_dynamics.fmu", dz=[3.0])
    energies, crank = [], []
    for k in range(60):
        q = slave.get("q")
        dq = (coordinates.compute_tangent(q[None])[0] @ slave.get("dz")).ravel()
        energies.append(float(oracle.energy(q, dq, values)))
        crank.append(q[0])
        slave.unit.doStep(0.01 * k, 0.01)
    assert np.ptp(crank) > 1
    assert np.ptp(energies) < 1e-8 * np.ptp(crank) * np.abs(energies).max()


@needs_gcc
@pytest.mark.parametrize("robot", ["two_link", "four_bar", "delta"])
def test_the_inverse_unit_undoes_the_simulation(tmp_path, robot):
    exported = write_units(tmp_path, robot)
    prefix, n = ("z" if exported.closures else "q"), exported.independent.size
    tau = 0.1 * np.abs(exported.cases["tau"]).max() * np.cos(np.arange(n))
    direct = Slave(tmp_path / f"{robot}_forward_dynamics.fmu", tau=tau)
    inverse = Slave(tmp_path / f"{robot}_inverse_dynamics.fmu")
    for k in range(10):
        direct.unit.doStep(0.005 * k, 0.005)
        for name in (prefix, f"d{prefix}", f"dd{prefix}"):
            inverse.set(name, direct.get(name))
        inverse.unit.doStep(0.005 * k, 0.005)
        np.testing.assert_allclose(inverse.get("tau"), tau, atol=1e-9 * np.abs(tau).max())
    assert np.abs(direct.get(f"d{prefix}")).max() > 1e-3


@needs_gcc
def test_stored_torques_parameters_and_matrices(tmp_path):
    exported = write_units(tmp_path, "two_link", Exported.IDM)
    slave = Slave(tmp_path / "two_link_inverse_dynamics.fmu")
    scale = np.abs(exported.cases["tau"]).max()
    for k in range(8):
        for name in ("q", "dq", "ddq"):
            slave.set(name, exported.cases[name][k])
        slave.unit.doStep(0.01 * k, 0.01)
        np.testing.assert_allclose(slave.get("tau"), exported.cases["tau"][k], atol=1e-12 * scale)
    slave.set("phi", 2 * exported.cases["phi"][0])
    np.testing.assert_allclose(slave.get("tau"), 2 * exported.cases["tau"][7], atol=1e-12 * scale)
    exported = write_units(tmp_path, "two_link", Exported.MASS_MATRIX, constant=True)
    slave = Slave(tmp_path / "two_link_mass_matrix.fmu", q=exported.cases["q"][0])
    np.testing.assert_allclose(slave.get("M"), exported.cases["M"][0], atol=1e-12)
    assert "phi" not in slave.references


@needs_gcc
def test_a_state_is_kept_and_taken_back(tmp_path):
    write_units(tmp_path, "four_bar")
    slave = Slave(tmp_path / "four_bar_forward_dynamics.fmu")
    slave.unit.doStep(0, 0.05)
    state = slave.unit.getFMUState()
    kept = slave.unit.serializeFMUState(state)
    slave.unit.doStep(0.05, 0.1)
    later = slave.get("q")
    slave.unit.setFMUState(slave.unit.deserializeFMUState(kept))
    slave.unit.doStep(0.05, 0.1)
    np.testing.assert_array_equal(slave.get("q"), later)
    slave.unit.freeFMUState(state)


@needs_gcc
def test_what_cannot_be_done_is_an_error_of_the_unit(tmp_path):
    write_units(tmp_path, "four_bar")
    slave = Slave(tmp_path / "four_bar_forward_dynamics.fmu")
    for wrong in (
        lambda: slave.set("ddz", [1.0]),  # an output
        lambda: slave.set("z", [1.0]),  # a state, after the initialisation
        lambda: slave.unit.setFloat64([99], [1.0]),
        lambda: slave.unit.getInt32([1]),
    ):
        with pytest.raises(FMICallException):
            wrong()
    slave.set("longest_step", [0.0])
    with pytest.raises(FMICallException):
        slave.unit.doStep(0, 0.1)
    inverse = Slave(tmp_path / "four_bar_inverse_dynamics.fmu")
    inverse.set("z", [np.nan])
    with pytest.raises(FMICallException):
        inverse.get("tau")


@pytest.mark.parametrize("what", [Exported.FORWARD_DYNAMICS, Exported.BOTH, Exported.DDM])
def test_massless_coordinates_are_not_simulated(tmp_path, what):
    with pytest.raises(DataError, match="forward-dynamics: no mass moves with road"):
        write_units(tmp_path, "wishbone", what)


def test_unmeasured_torques_are_not_simulated():
    model = dataclasses.replace(model_of("two_link"), nominal_torque=np.array([20, np.inf]))
    with pytest.raises(DataError, match="the torques of z_fore were not measured"):
        make_exported_model(
            model, make_full_model(model), title="x", what=Exported.FORWARD_DYNAMICS
        )


def test_without_a_compiler_a_unit_holds_its_source(tmp_path, monkeypatch):
    monkeypatch.setattr(units, "find_compiler", lambda: None)
    with pytest.warns(ParamreduceWarning, match="holds its source but no binary"):
        write_units(tmp_path, "two_link", Exported.IDM)
    with zipfile.ZipFile(tmp_path / "two_link_inverse_dynamics.fmu") as archive:
        names = archive.namelist()
    assert sorted(names) == [
        "modelDescription.xml", "sources/buildDescription.xml",
        "sources/two_link_inverse_dynamics.c",
    ]  # fmt: skip


@needs_gcc
def test_equal_models_give_equal_units(tmp_path):
    first, second = tmp_path / "a", tmp_path / "b"
    for folder in (first, second):
        folder.mkdir()
        write_units(folder, "two_link", Exported.IDM)
    name = "two_link_inverse_dynamics.fmu"
    assert (first / name).read_bytes() == (second / name).read_bytes()
