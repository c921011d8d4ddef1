"""Simulated motions against Lagrange's equations with multipliers, and by their energy."""

import h5py
import numpy as np
import pytest
from conftest import TWO_LINK, config_and_model
from oracles.lagrange import Lagrange, forward_dynamics
from scipy.integrate import simpson

from paramreduce_cli.excitation.input_signals import Harmonics, Joined
from paramreduce_cli.excitation.simulation import Inputs, TextbookMassAndBias, simulate
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.records import Recordings
from paramreduce_cli.stages.sample import sample

SHORT = ["sampling.simulation.runs=2", "sampling.simulation.duration=1"]


@pytest.fixture(scope="module", params=["cart_pole", "quarter_car"])
def simulated(request):
    config, model = config_and_model(request.param, *SHORT)
    return model, sample(config.sampling, model, None, Recordings(None, None, None))


def test_how_many_motions_are_simulated_is_told():
    config, model = config_and_model(
        "cart_pole",
        *SHORT,
        "sampling.simulation.validation_runs=1",
        "sampling.simulation.test_runs=1",
    )
    told = []
    sample(config.sampling, model, None, Recordings(None, None, None), report_progress=told.append)
    assert [(one.task, one.done, one.total) for one in told] == [
        ("simulate motions of the estimation set", 1, 2),
        ("simulate motions of the estimation set", 2, 2),
        ("simulate motions of the validation set", 1, 1),
        ("simulate motions of the test set", 1, 1),
    ]


def test_accelerations_are_those_of_the_oracle(simulated):
    model, samples = simulated
    mechanism, oracle = model.mechanism, Lagrange(model.mechanism)
    independent = list(mechanism.independent)
    for block in samples.estimation.iterate_blocks():
        for k in range(0, block.time.size, 20):
            q, dq, tau = block.q[k], block.dq[k], block.tau[k]
            ddq = forward_dynamics(oracle, independent, q, dq, model.values, tau)[independent]
            assert block.ddz[k] == pytest.approx(ddq, rel=1e-8, abs=1e-8 * np.abs(ddq).max())


def test_torques_fit_the_full_model_and_are_zero_where_there_is_no_input(simulated):
    model, samples = simulated
    passive = [name not in ("s", "z_wheel") for name in model.mechanism.coordinate_names]
    blocks = list(samples.estimation.iterate_blocks())
    assert {block.trajectory for block in blocks} == {0, 1}
    for block in blocks:
        predicted = (block.W @ model.values).reshape(block.tau.shape)
        assert predicted == pytest.approx(block.tau, abs=1e-9 * np.abs(block.tau).max())
        assert not block.tau[:, passive].any()


def test_energy_is_what_inputs_brought_and_friction_took():
    _, model = config_and_model("cart_pole", *SHORT)
    mechanism, oracle = model.mechanism, Lagrange(model.mechanism)
    time = np.linspace(0, 2, 2001)
    waves = np.array([2 * np.exp(1j * np.array([0.3, 1.0])), [0, 0]])
    none = np.empty(0, dtype=np.int64)
    forces = Harmonics(2 * np.pi * np.array([0.7, 1.9]), waves)
    push = Inputs(forces, np.array([5.0, 0]), np.array([1.0, 0]), np.zeros(2), none, Joined([]))
    start = np.array([0.1, 0.8])
    direct = TextbookMassAndBias(Dynamics(mechanism), model.values)
    motion = simulate(direct, push, start, np.zeros(2), time)
    n = time.size
    states = motion.z.T, motion.dz.T, np.zeros_like(motion.dz.T)
    phi = np.tile(model.values, (n, 1)).T
    energy = oracle.energy.map(n)(motion.z.T, motion.dz.T, phi).full().ravel()
    conservative = model.values.copy()
    drives = [k for k, p in enumerate(mechanism.parameters) if p.kind.symbol in ("fv", "fc")]
    conservative[drives] = 0.0
    friction = oracle.tau.map(n)(*states, phi) - oracle.tau.map(n)(
        *states, np.tile(conservative, (n, 1)).T
    )
    power = np.sum((motion.tau - friction.full().T) * motion.dz, axis=1)
    brought = simpson(power, x=time)
    assert abs(brought) > 0.1
    assert energy[-1] - energy[0] == pytest.approx(brought, rel=1e-5)


def test_loops_stay_closed(simulated):
    model, samples = simulated
    if model.mechanism.loops is None:
        pytest.skip("has no loops")
    block = next(iter(samples.validation.iterate_blocks()))
    again = Coordinates(model.mechanism).compute_positions(block.z, None)
    assert again == pytest.approx(block.q, abs=1e-9)


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        (["inputs={z_fore: {amplitude: 1}}"], "belong together"),
        (
            ["inputs={z_fore: {amplitude: 1, frequencies: [1]}}", "start={z_upper: [1, -1]}"],
            "the range crosses",
        ),
        (["inputs={q_1: {amplitude: 1, frequencies: [1]}}"], "'q_1'"),
        (["inputs={z_fore: {amplitude: 1, frequencies: [1]}}", "step=2"], "is too long for 10 s"),
        (
            ["inputs={z_fore: {amplitude: 1, frequencies: [1]}}", "step=1e-9"],
            "more than 1000000 samples",
        ),
        (["inputs={z_fore: {amplitude: -1, frequencies: [1]}}"], "greater than or equal to 0"),
        (
            ["inputs={z_fore: {amplitude: 1e12, frequencies: [1]}}", "duration=0.5"],
            "cannot be followed beyond",
        ),
    ],
)
def test_simulations_that_cannot_be_are_refused(invoke, tmp_path, settings, says):
    changes = [f"sampling.simulation.{setting}" for setting in settings]
    given = (TWO_LINK, "--results", tmp_path)
    out = invoke("run", *given, settings=changes, code=2)
    assert says in " ".join(out.err.split())


def test_a_sign_that_jumps_is_refused(invoke, tmp_path):
    settings = [
        "sampling.simulation.inputs={z_fore: {amplitude: 1, frequencies: [1]}}",
        "drives.all.coulomb=1",
    ]
    out = invoke("run", TWO_LINK, "--results", tmp_path, settings=settings, code=2)
    assert "needs a smoothing" in " ".join(out.err.split())


def test_bodies_without_mass_cannot_be_simulated(invoke, tmp_path):
    settings = ["parameter_sets.nominal.pole={m: 0}", "validation.accept={}"]
    path = TWO_LINK.parent / "cart_pole.yaml"
    out = invoke("run", path, "--results", tmp_path, settings=settings, code=2)
    assert "the mass matrix is singular" in " ".join(out.err.split())


SPRUNG = """
robot: sprung
description:
  gravity: [0, 0, -9.81]
  tree:
    bodies:
      - {name: ground, joint: prismatic, coordinates: ground, massless: true}
      - {name: wheel, joint: prismatic, coordinates: wheel}
      - {name: car, joint: prismatic, coordinates: car}
      - {name: trolley, joint: prismatic, axes: x, coordinates: trolley}
parameter_sets: {p: {wheel: {m: 40}, car: {m: 300}, trolley: {m: 2}}}
drives:
  strut: {motion: {car: 1, wheel: -1}, stiffness: 2e4, viscous: 1500, rest: 0.1}
forces:
  tyre: {type: tyre, bodies: [ground, wheel], at: [[0, 0, 0], [0, 0, 0]], radius: 0.3, stiffness: 2e5, viscous: 200}
nominal_torque: [1000, 1000, 1000, 1]
sampling:
  simulation:
    equilibrium: true
    speed: {trolley: 2}
    motions: {ground: {amplitude: 0.02, frequencies: [1.3]}}
    duration: 2
    step: 0.01
    runs: 1
    test_runs: 0
"""


def write_sprung(folder, *changes):
    text = SPRUNG
    for old, new in changes:
        assert text.count(old) == 1
        text = text.replace(old, new)
    path = folder / "sprung.yaml"
    path.write_text(text)
    return path


def test_prescribed_motions_are_followed_and_their_torques_are_what_they_take(invoke, tmp_path):
    path = write_sprung(tmp_path)
    invoke("build-model", path, "--results", tmp_path)
    invoke("sample", path, "--results", tmp_path)
    with h5py.File(tmp_path / "samples.h5") as file:
        z, dz, ddz, tau = (file[f"estimation/{key}"][()] for key in ("z", "dz", "ddz", "tau"))
        time, nominal = file["estimation/time"][()], file["nominal_acceleration"][()]
    assert np.isinf(nominal[0])
    assert np.isfinite(nominal[1:]).all()
    fit = np.column_stack([np.sin(2 * np.pi * 1.3 * time), np.cos(2 * np.pi * 1.3 * time)])
    (a, b), *_ = np.linalg.lstsq(fit, z[:, 0], rcond=None)
    np.testing.assert_allclose(fit @ [a, b], z[:, 0], atol=1e-12)
    assert np.hypot(a, b) == pytest.approx(0.02)
    tyre = 2e5 * (z[:, 1] - z[:, 0] - 0.3) + 200 * (dz[:, 1] - dz[:, 0])
    strut = 2e4 * (z[:, 2] - z[:, 1] - 0.1) + 1500 * (dz[:, 2] - dz[:, 1])
    np.testing.assert_allclose(tau[:, 0], -tyre, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(40 * (ddz[:, 1] + 9.81), strut - tyre, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(300 * (ddz[:, 2] + 9.81), -strut, rtol=1e-9, atol=1e-6)
    # Static equilibrium at the start: what tyre and strut carry, and a trolley that nothing holds.
    ground = z[0, 0]
    assert z[0, 1] == pytest.approx(ground + 0.3 - 340 * 9.81 / 2e5, abs=1e-9)
    assert z[0, 2] == pytest.approx(z[0, 1] + 0.1 - 300 * 9.81 / 2e4, abs=1e-9)
    assert z[0, 3] == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(dz[:, 3], 2, atol=1e-9)


def test_a_road_from_a_file_is_met_with_delay(invoke, tmp_path):
    distance = np.arange(0, 40, 0.1)
    np.savetxt(
        tmp_path / "road.csv",
        np.column_stack([distance, 0.03 * np.sin(distance)]),
        delimiter=",", header="distance,height", comments="",
    )  # fmt: skip
    road = "road: {speed: 10, tracks: [[ground, trolley]], distances: [0, 3], file: road.csv}"
    path = write_sprung(tmp_path, ("motions: {ground: {amplitude: 0.02, frequencies: [1.3]}}", road),
                        ("    speed: {trolley: 2}\n", ""))  # fmt: skip
    invoke("build-model", path, "--results", tmp_path)
    invoke("sample", path, "--results", tmp_path)
    with h5py.File(tmp_path / "samples.h5") as file:
        z, time = file["estimation/z"][()], file["estimation/time"][()]
    np.testing.assert_allclose(z[:, 0], 0.03 * np.sin(10 * time + 3), atol=1e-5)
    np.testing.assert_allclose(z[:, 3], 0.03 * np.sin(10 * time), atol=1e-5)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ([("drives:\n", "drives:\n  wheel: {offset: 10}\n"),
          ("motion: {car: 1, wheel: -1}, stiffness: 2e4", "motion: {car: 1, wheel: -1}, stiffness: 0")],
         "there is no static equilibrium"),
        ([("{amplitude: 0.02, frequencies: [1.3]}", "{file: short.csv}")], "holds 0 to 1 s"),
        ([("{amplitude: 0.02, frequencies: [1.3]}", "{file: holes.csv}")], "row 3 has a number that is not"),
        ([("speed: {trolley: 2}", "speed: {ground: 2}")], "whose motion is prescribed"),
        ([("motions: {ground", "motions: {wheel: {amplitude: 0}, car: {amplitude: 0}, trolley: {amplitude: 0}, ground"),
          ("    speed: {trolley: 2}\n", "")], "prescribes the motion of all coordinates"),
        ([("ground: {amplitude", "gruond: {amplitude")], "Did you mean ground?"),
        ([("    step: 0.01\n", "    step: 0.01\n    inputs: {ground: {amplitude: 1, frequencies: [1]}}\n")],
         "whose motion is prescribed"),
        ([("motions: {ground: {amplitude: 0.02, frequencies: [1.3]}}",
           "road: {speed: 10, tracks: [[ground, wheel]], distances: [0]}")], "each track needs 1"),
    ],
)  # fmt: skip
def test_vehicles_that_cannot_be_simulated_are_refused(invoke, tmp_path, changes, says):
    np.savetxt(tmp_path / "short.csv", np.linspace([0, 0], [1, 0.1], 20), delimiter=",",
               header="time,height", comments="")  # fmt: skip
    (tmp_path / "holes.csv").write_text(
        "time,height\n" + "".join(f"{k},{'nan' if k == 2 else 0}\n" for k in range(20))
    )
    path = write_sprung(tmp_path, *changes)
    out = invoke("run", path, "--results", tmp_path, code=2)
    assert says in " ".join(out.err.split())
    assert "Traceback" not in out.err
