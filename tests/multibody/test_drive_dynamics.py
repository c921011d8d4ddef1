"""Rotors, friction, springs and payloads against Lagrange's equations, Pinocchio and Coulomb's law."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from conftest import MECHANISMS, PUMA_ROWS, config_of, dh, mechanism_of, slope
from conftest import random_states as tree_states
from oracles import pinocchio_model
from oracles.lagrange import Lagrange, tangent
from scipy.spatial.transform import Rotation

from paramreduce_cli.lean.joint_formulations import JointFormulation, to_data
from paramreduce_cli.lean.lean_verification import check_formulations
from paramreduce_cli.multibody.base_parameters import choose_base, find_affecting_columns
from paramreduce_cli.multibody.drive_motions import sum_weighted
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.assembly import assemble
from paramreduce_cli.multibody.random_states import draw_states
from paramreduce_cli.multibody.textbook_dynamics import PlainDynamics
from paramreduce_cli.records import DRIVE, INERTIAL, Drive, Formulations, Kind, Parameter, Payload

EVERYTHING = tuple(k for k in DRIVE if "table" not in k.key and k is not Kind.CREEP)


def with_everything(mechanism, seed=0):
    """A drive on each coordinate, one on a sum of several, and a payload on the last body."""
    rng = np.random.default_rng(seed)
    n = mechanism.n_q
    drives = [
        Drive(f"d{k}", weights, smoothing=0.3 * (k % 2), rest=0.2 * k, stribeck_velocity=0.7)
        for k, weights in enumerate(np.eye(n))
    ]
    coupled = np.zeros(n)
    coupled[[0, n - 1]] = 2.0, -0.5
    drives.append(Drive("coupled", coupled, rest=-0.3))
    frame = np.eye(4)
    frame[:3, :3] = Rotation.random(random_state=rng).as_matrix()
    frame[:3, 3] = rng.normal(size=3)
    inertial = INERTIAL
    parameters = (
        *mechanism.parameters,
        *(Parameter(kind, "load") for kind in inertial),
        *(Parameter(kind, drive.name) for drive in drives for kind in EVERYTHING),
    )
    return dataclasses.replace(
        mechanism,
        drives=tuple(drives),
        payloads=(Payload("load", n - 1, frame),),
        parameters=parameters,
        nominal=rng.uniform(0.5, 2, size=len(parameters)),
    )


def relative(found, expected):
    return np.abs(found - expected).max() / np.abs(expected).max()


@pytest.fixture(params=[*MECHANISMS, "five_bar", "delta"])
def case(request):
    """A mechanism, its oracle and states."""
    name = request.param
    if name in MECHANISMS:
        mechanism = with_everything(MECHANISMS[name]())
        return mechanism, Lagrange(mechanism), tree_states(mechanism, 12)
    mechanism = with_everything(assemble(config_of(name).build_mechanism()))
    return mechanism, Lagrange(mechanism), draw_states(mechanism, 6, np.random.default_rng(1))


def test_regressor_agrees_with_lagrange(case):
    mechanism, oracle, states = case
    phi = np.random.default_rng(2).uniform(0.5, 2, size=mechanism.n_parameters)
    found = Dynamics(mechanism).compute_regressor(*states)
    for K, q, dq, ddq in zip(found, *states, strict=True):
        expected = np.array(oracle.tau_by_phi(q, dq, ddq, phi))
        R = tangent(oracle, mechanism.independent, q)
        assert relative(K, R.T @ expected) < 1e-11


def test_mass_matrix_and_bias_are_those_of_the_same_torques(case):
    mechanism, oracle, states = case
    q, dq, ddq = states
    phi = np.random.default_rng(3).uniform(0.5, 2, size=mechanism.n_parameters)
    dynamics = Dynamics(mechanism)
    M, delta = dynamics.compute_mass_matrix_and_bias(q, dq, phi)
    z = list(mechanism.independent)
    together = np.einsum("kij,kj->ki", M, ddq[:, z]) + delta
    assert relative(together, dynamics.compute_torques(q, dq, ddq, phi)) < 1e-11
    for own, at in zip(M, q, strict=True):
        R = tangent(oracle, mechanism.independent, at)
        assert relative(own, R.T @ np.array(oracle.mass_matrix(at, phi)) @ R) < 1e-10


def test_lean_models_are_the_same(case):
    mechanism, _, states = case
    same = (to_data(JointFormulation()),) * mechanism.n_q
    everything = np.arange(mechanism.n_parameters)
    uniform = Formulations((same,), (same,))  # no choice at a joint has to do with drives
    check_formulations(mechanism, uniform, everything, states, np.random.default_rng(0))


def test_plain_recursion_is_the_same():
    mechanism = with_everything(MECHANISMS["tree"]())
    phi = np.random.default_rng(3).uniform(0.5, 2, size=mechanism.n_parameters)
    z, dz, ddz = tree_states(mechanism, 10)
    tau = Dynamics(mechanism).compute_torques(z, dz, ddz, phi)
    again = PlainDynamics(mechanism).express_accelerations(phi).map(10)(z.T, dz.T, tau.T).full().T
    assert relative(again, ddz) < 1e-8


def test_adjoint_through_smooth_friction():
    mechanism = with_everything(MECHANISMS["tree"]())
    smooth = [dataclasses.replace(drive, smoothing=0.4) for drive in mechanism.drives]
    mechanism = dataclasses.replace(mechanism, drives=tuple(smooth))
    observation = Dynamics(mechanism).make_observation(np.arange(40, mechanism.n_parameters))
    states = tree_states(mechanism, 4)
    rng = np.random.default_rng(3)
    seed = rng.normal(size=observation.evaluate(*states).shape)
    for which, gradient in enumerate(observation.compute_vector_jacobian_product(*states, seed)):
        direction = rng.normal(size=gradient.shape)
        found = slope(lambda *s: np.sum(observation.evaluate(*s) * seed), states, direction, which)
        assert found == pytest.approx(np.sum(gradient * direction), rel=1e-6, abs=1e-6)


def test_rotors_and_payloads_agree_with_pinocchio():
    mechanism = with_everything(MECHANISMS["puma"]())
    rng = np.random.default_rng(5)
    names = mechanism.parameter_names
    phi = rng.uniform(-1, 1, size=mechanism.n_parameters)
    phi[:60:10] = rng.uniform(0.5, 3, size=6)
    rotors = [names.index(f"Ia_d{k}") for k in range(6)]
    phi[[k for k, p in enumerate(mechanism.parameters) if p.kind in EVERYTHING]] = 0.0
    phi[rotors] = rng.uniform(0.1, 1, size=6)
    load = names.index("m_load")
    phi[load] = 1.7
    model, data, offsets = pinocchio_model.build(mechanism, phi)
    ours = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]
    carried = pin.Inertia.FromDynamicParameters(phi[load : load + 10][ours])
    last = mechanism.bodies[-1]
    model.appendBodyToJoint(6, carried, pin.SE3(last.joint_to_body @ mechanism.payloads[0].frame))
    model.armature = phi[rotors]
    data = model.createData()
    states = tree_states(mechanism, 30)
    expected = [
        pin.rnea(model, data, q + offsets, dq, ddq) for q, dq, ddq in zip(*states, strict=True)
    ]
    assert relative(Dynamics(mechanism).compute_torques(*states, phi), np.array(expected)) < 1e-11


def test_friction_by_definition():
    mechanism = mechanism_of(
        dh([(None, None, "revolute"), (None, None, "revolute", 0.5)]),
        drives={
            "all": {"viscous": 2.0, "coulomb": 3.0},
            "z_2": {"offset": 0.7, "smoothing": 0.1},
            "both": {"motion": {"z_1": 1.0, "z_2": -2.0}, "coulomb": 5.0},
        },
    )
    assert mechanism.parameter_names[20:] == (
        "fv_z_1", "fc_z_1", "fv_z_2", "fc_z_2", "off_z_2", "fc_both",
    )  # fmt: skip
    phi = np.zeros(26)
    phi[20:] = 2.0, 3.0, 2.0, 3.0, 0.7, 5.0
    dq = np.array([[-0.3, 0.2], [0.0, 0.05], [1.0, 0.5]])
    tau = Dynamics(mechanism).compute_torques(np.zeros((3, 2)), dq, np.ones((3, 2)), phi)
    both = 5.0 * np.sign(dq @ [1, -2])
    first = 2 * dq[:, 0] + 3 * np.sign(dq[:, 0]) + both
    second = 2 * dq[:, 1] + 3 * np.tanh(dq[:, 1] / 0.1) + 0.7 - 2 * both
    assert tau == pytest.approx(np.column_stack([first, second]), abs=1e-12)


def test_friction_per_load_by_hand():
    """A gear of 50 at a level arm of 2 kg m: a tenth of the load, whatever the ratio."""
    mechanism = mechanism_of(
        dh([("arm", None, "revolute")]),
        gravity=[0, -9.81, 0],
        parameter_sets={"cad": {"arm": {"m": 4, "com": [0.5, 0, 0]}}},
        drives={"motor": {"motion": {"z_arm": 50.0}, "load": 0.1, "smoothing": 5.0}},
    )
    phi = np.zeros(11)
    phi[-1] = 0.1
    q, dq = np.array([[0.0], [1.0], [3.0]]), np.array([[0.3], [-0.2], [0.0]])
    tau = Dynamics(mechanism).compute_torques(q, dq, 0 * q, phi)
    expected = 0.1 * 2 * 9.81 * np.abs(np.cos(q)) * np.tanh(50 * dq / 5)
    assert tau == pytest.approx(expected, abs=1e-12)


def test_what_a_motor_behind_gears_adds():
    """A rotor of 2e-4 kg m^2 behind a gear of 62.6 weighs 0.784 kg m^2 at the joint."""
    description = dh([(None, None, "revolute")])
    behind = {"motor": {"motion": {"z_1": 62.6}, "inertia": 2e-4, "viscous": 1e-3}}
    mechanism = mechanism_of(description, drives=behind)
    ones = np.ones((1, 1))
    K = Dynamics(mechanism).compute_regressor(ones, 2 * ones, 3 * ones)[0, 0, 10:]
    assert pytest.approx([3 * 62.6**2, 2 * 62.6**2]) == K
    assert sum_weighted(mechanism.drives[0].weights, [0.5]) == pytest.approx(31.3)


def test_base_of_the_puma_with_friction_and_rotors():
    """Rotors of the first joints regroup into Izz [Khalil2002]; friction is always independent."""
    rows = [
        (str(k + 1), str(k) if k else None, "revolute", a, alpha, d)
        for k, (a, alpha, d) in enumerate(PUMA_ROWS)
    ]
    drives = {"all": {"inertia": 1.0, "viscous": 1.0, "coulomb": 1.0, "offset": 1.0}}
    mechanism = mechanism_of(dh(rows), drives=drives)
    oracle = Lagrange(mechanism)
    states = tree_states(mechanism, 60)
    W = np.vstack(
        [np.array(oracle.tau_by_phi(*state, np.ones(84))) for state in zip(*states, strict=True)]
    )
    lengths = np.linalg.norm(W, axis=0)
    live = lengths > 1e-10 * lengths.max()
    singular = np.linalg.svd(W[:, live] / lengths[live], compute_uv=False)
    rank = int(np.sum(singular > 1e-9 * singular[0]))
    K = Dynamics(mechanism).compute_regressor(*states).reshape(-1, 84)
    base = choose_base(K, mechanism.preference_order, 1e-9)
    assert base.columns.size == rank
    names = {mechanism.parameter_names[k] for k in base.columns}
    assert {f"{kind}_z_{k}" for kind in ("fv", "fc", "off") for k in range(1, 7)} <= names
    assert "Ia_z_1" not in names
    assert {"Ia_z_3", "Ia_z_4", "Ia_z_5", "Ia_z_6"} <= names
    assert find_affecting_columns(K).sum() == live.sum()


def test_a_payload_in_the_bodys_frame_adds_nothing_to_the_base():
    description = dh([("1", None, "revolute"), ("2", None, "revolute", 0.5, 0.4)])
    plain = mechanism_of(description)
    loaded = mechanism_of(
        description, payloads={"tool": {"body": "2", "at": [{"xyz": [0.1, 0, 0.2]}, {"rx": 0.3}]}}
    )
    counts = []
    for mechanism in (plain, loaded):
        K = Dynamics(mechanism).compute_regressor(*tree_states(mechanism, 60))
        W = K.reshape(-1, mechanism.n_parameters)
        counts.append(choose_base(W, mechanism.preference_order, 1e-9).columns.size)
    assert counts[0] == counts[1]
