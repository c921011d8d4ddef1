"""A manoeuvre with the full and with the selected model, against an integration of its own."""

import json

import numpy as np
import pytest
from conftest import CONFIGS, config_and_model
from oracles.lagrange import Lagrange, forward_dynamics
from scipy.integrate import solve_ivp

from paramreduce_cli.artifacts.store import load_file
from paramreduce_cli.cli.commands.run import run
from paramreduce_cli.excitation.manoeuvres import draw_manoeuvres
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.records import Samples, SignalTables, SimulatedManoeuvre


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A quarter of a car; its model of few parameters leaves out what the motion shows."""
    folder = tmp_path_factory.mktemp("quarter")
    settings = ["report.formats=[svg]", "validation.stability=false", "selected.torque_error=0.02",
                "sampling.simulation.duration=1", "reduction.heuristics=[swap]", "validation.accept={}"]  # fmt: skip
    words = [str(CONFIGS / "quarter_car.yaml"), "--results", str(folder), "--quiet"]
    run.main([*words, *(w for s in settings for w in ("--set", s))], standalone_mode=False)
    return folder


def integrate(model, values, manoeuvre):
    """Positions by Lagrange's equations, integrated by another method."""
    mechanism, oracle = model.mechanism, Lagrange(model.mechanism)
    independent = list(mechanism.independent)
    n = mechanism.n_dof
    coordinates = Coordinates(mechanism)

    def rates(time, state):
        z, dz = state[:n], state[n:]
        q, dq, _ = coordinates.compute_states(z[None], dz[None], np.zeros((1, n)))
        tau = manoeuvre.inputs.compute_forces(time, z, dz)
        ddq = forward_dynamics(oracle, independent, q[0], dq[0], values, tau)
        return np.concatenate([dz, ddq[independent]])

    start = np.concatenate([manoeuvre.start, manoeuvre.speed])
    time = manoeuvre.time[:21]
    return solve_ivp(
        rates, (0, time[-1]), start, "RK45", time, rtol=1e-8, atol=1e-10
    ).y.T[:, :n]  # fmt: skip


def test_the_report_shows_how_far_the_selected_model_strays(results):
    summary = json.loads((results / "report" / "summary.json").read_text())
    found = summary["manoeuvre"]
    assert found["set"] == "test"
    assert set(found["coordinates"]) == {"z_chassis", "z_wheel"}
    # The selected model is not the full one, and follows it all the same.
    assert 1e-6 < found["position_error"] < 0.05
    assert 1e-6 < found["acceleration_error"] < 0.05
    page = (results / "report" / "index.html").read_text()
    assert "Simulated manoeuvre" in page
    assert "in a simulated manoeuvre of the test set" in page


def test_manoeuvres_are_those_of_the_samples(results):
    settings = ["sampling.simulation.duration=1"]
    config, model = config_and_model("quarter_car", *settings)
    section = config.sampling.simulation
    first = next(draw_manoeuvres(section, model.mechanism, SignalTables({}), "test"))
    samples, _ = load_file(results / "samples.h5", Samples, None, "sample")
    block = next(iter(samples.test.iterate_blocks()))
    z = integrate(model, model.values, first)
    assert block.z[:21] == pytest.approx(z, abs=2e-6)


def test_deviations_by_hand():
    time = np.linspace(0, 1, 5)
    full = np.column_stack([3 + np.array([1, -1, 1, -1, 0.0]), np.zeros(5), np.zeros(5)])
    selected = full + np.column_stack([np.full(5, 0.1), np.zeros(5), np.full(5, 1e-3)])
    motion = {"position": full, "acceleration": full}
    other = {"position": selected, "acceleration": selected}
    found = SimulatedManoeuvre("test", ("a", "still", "b"), time, motion, other)
    assert found.compute_rms("position")[0] == pytest.approx(np.sqrt(4 / 5))
    assert found.compute_rms("acceleration")[0] == pytest.approx(np.sqrt((2 * 16 + 2 * 4 + 9) / 5))
    assert found.compute_deviations("position") == pytest.approx([0.1 / np.sqrt(0.8), 0, np.inf])
    assert found.compute_error("position") == np.inf
