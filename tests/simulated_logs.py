"""Logs of a machine whose truth is known."""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from paramreduce_cli.config import load_config
from paramreduce_cli.excitation.fourier import evaluate_basis
from paramreduce_cli.multibody.base_parameters import choose_base
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.random_states import draw_states
from paramreduce_cli.records import RawLog, RawLogs

CONFIG = Path(__file__).resolve().parents[1] / "configs" / "puma560_friction.yaml"
RATE = 100.0
SECONDS = 20.0


@dataclass(frozen=True)
class Simulated:
    """States of a smooth motion and exact torques, with columns of the base parameters."""

    names: tuple[str, ...]
    time: np.ndarray
    z: np.ndarray
    dz: np.ndarray
    ddz: np.ndarray
    tau: np.ndarray
    X: np.ndarray
    """(n_samples, n_dof, r)"""
    values: np.ndarray
    """Of the base parameters, (r,)."""
    kinds: tuple[str, ...]
    """Of the base parameters."""


@cache
def arm():
    """Mechanism, dynamics, base parameters and values in puma560_friction.yaml."""
    config = load_config(CONFIG)
    mechanism = config.build_mechanism()
    dynamics = Dynamics(mechanism)
    K = dynamics.compute_regressor(*draw_states(mechanism, 300, np.random.default_rng(0)))
    base = choose_base(K.reshape(-1, K.shape[2]), mechanism.preference_order, 1e-9)
    return mechanism, dynamics, base, config.get_values()


def simulated(seed):
    """A motion of the arm with friction in puma560_friction.yaml."""
    mechanism, dynamics, base, values = arm()
    rng = np.random.default_rng(seed)
    harmonics = 5
    time = np.arange(0, SECONDS, 1 / RATE)
    basis = evaluate_basis(SECONDS / 2, harmonics, time)
    series = rng.normal(size=(mechanism.n_dof, 1 + 2 * harmonics))
    series[:, 0] *= 0.3
    z, dz, ddz = basis.evaluate(series * 0.6)
    K = dynamics.compute_regressor(z, dz, ddz)
    others = np.setdiff1d(np.arange(values.size), base.columns)
    return Simulated(
        mechanism.coordinate_names, time, z, dz, ddz, K @ values, K[:, :, base.columns],
        values[base.columns] + base.beta @ values[others],
        tuple(mechanism.parameters[k].kind.symbol for k in base.columns),
    )  # fmt: skip


def record_encoder(log, tau, bits, extra=()):
    """A recording of a simulated log: positions of an encoder, exact ones for no bits, and torques."""
    step = 2 * np.pi / 2**bits if bits else 0.0
    positions = np.round(log.z / step) * step if step else log.z
    return make_recording(log.time, positions, tau, extra)


def make_recording(time, positions, tau, extra=()):
    """A recording of some positions and torques."""
    columns = {"t": time, **dict(extra)}
    for name, values in (("q", positions), ("tau", tau)):
        columns |= {f"{name}{j}": column for j, column in enumerate(values.T, 1)}
    return RawLogs((RawLog("log.csv", columns, 2),), ())


def along_axes(z, dz, ddz):
    """Observation matrices (n_samples, n_dof, n) of the arm, and what gravity of one unit along each axis adds, (3, ...)."""
    mechanism, dynamics, _, _ = arm()
    none = Dynamics(replace(mechanism, gravity=np.zeros(3))).compute_regressor(z, dz, ddz)
    axes = [
        Dynamics(replace(mechanism, gravity=axis)).compute_regressor(z, dz, ddz)
        for axis in np.eye(3)
    ]
    return dynamics.compute_regressor(z, dz, ddz), np.array(axes) - none


def coloured(shape, size, pole, seed):
    """Noise that forgets as a first-order system does, of a size for each joint."""
    rng = np.random.default_rng([seed, 1])
    settled = 1000
    noise = lfilter([1], [1, -pole], rng.normal(size=(shape[0] + settled, shape[1])), axis=0)
    return noise[settled:] * np.sqrt(1 - pole**2) * size


TWO_LINK = CONFIG.with_name("two_link.yaml")
FRICTION = {"upper": (0.8, 1.2, 0.3), "fore": (0.2, 0.5, -0.1)}
"""Viscous, Coulomb and constant torques of the two-link arm, N m s/rad, N m, N m."""
LOG_CONFIG = """
drives:
  all: {viscous: unknown, coulomb: unknown, offset: unknown}

sampling:
  log:
    files: log.csv
    torque_cutoff: 8
    folds: 4

reduction:
  weighting: noise
  heuristics: [forward-selection, essential]
"""


def two_link_log(seconds=12.0, rate=200.0, noise=0.05, seed=0, settings=()):
    """Columns of a log of the two-link arm with friction, by name."""
    config = load_config(TWO_LINK, list(settings))
    mechanism, values = config.build_mechanism(), config.get_values()
    rng = np.random.default_rng(seed)
    time = np.arange(0, seconds, 1 / rate)
    series = np.array([[0.0, 1.0, 0.6, -1.1, 0.4, 0.7, 0.9], [0.2, -0.8, 0.9, 1.2, -0.5, 0.9, 0.7]])
    z, dz, ddz = evaluate_basis(seconds / 2, 3, time).evaluate(1.2 * series)
    tau = Dynamics(mechanism, once=True).compute_regressor(z, dz, ddz) @ values
    for j, (viscous, coulomb, offset) in enumerate(FRICTION.values()):
        tau[:, j] += viscous * dz[:, j] + coulomb * np.sign(dz[:, j]) + offset
    tau += noise * rng.normal(size=tau.shape)
    columns = {"t": time}
    for name, values in (("q", z), ("dq", dz), ("tau", tau)):
        columns |= {f"{name}{j + 1}": values[:, j] for j in range(2)}
    return columns


def write_log(path, columns):
    """As CSV."""
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, "%.9g", ",", header=",".join(columns), comments="")


def log_config(folder, extra=""):
    """A config of the two-link arm for a log.csv beside it; its path."""
    text = TWO_LINK.read_text().replace(
        "selected:\n  heuristic: forward-selection\n  n: 4", "selected:\n  cross_validation: true"
    )
    text = text.replace("  accept:\n    torque_error_test: 0.05", "  stability: false")
    path = folder / "arm.yaml"
    path.write_text(text + LOG_CONFIG + extra)
    return path


def tilt_torques(seed):
    """Torques of gravity of one m/s^2 along x and y of the arm's base in the motion of a seed."""
    mechanism, _, _, values = arm()
    log = simulated(seed)
    still = np.zeros_like(log.z)
    return [
        Dynamics(replace(mechanism, gravity=axis)).compute_regressor(log.z, still, still) @ values
        for axis in np.eye(3)[:2]
    ]
