"""Arms under PD control, simulated: what an encoder and the drives record of them, and what a model of them would do.

The protocol is that of BIRDy: three industrial arms, one exciting reference, and logs that differ in their noise alone. The
noise of the encoder is in the loop, so that states and torques share it. Dimensions and masses are those of the Staubli TX40, the
Universal Robots UR3 and the Mitsubishi RV-2SQ, in round numbers. Friction and rotors of the TX40 are near published
values, those of the others are made up.
"""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from paramreduce_cli.excitation.fourier import evaluate_basis
from paramreduce_cli.expressions.compiled import BatchFunction
from paramreduce_cli.identification.quality import find_base
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.inverse_dynamics import express_mass_matrix_and_bias
from paramreduce_cli.records import Mechanism
from paramreduce_cli.robots import Robot
from tests.simulated_logs import coloured

RATE = 500.0
"""Control steps, and recorded samples, per second."""
SECONDS = 20.0
BITS = 16
"""Of the encoders, over a turn of the joint."""
_NOISE = 0.03
"""Standard deviation of the noise of torques, a share of each joint's torques."""
_PERIOD, _HARMONICS = 10.0, 5
_BANDWIDTH = 2 * np.pi * 6
"""Natural frequency of the controlled joints, rad/s; they are damped critically."""
_SPEED_FILTER = 2 * np.pi * 60
"""Cut-off of the controller's first-order low-pass on differentiated positions, rad/s."""

HALF = np.pi / 2
_ARMS = {
    "TX40": {
        "joints": [(0, 0, 0.32), (0, -HALF, 0.035), (0.225, 0, 0), (0, HALF, 0.225), (0, -HALF, 0), (0, HALF, 0.065)],
        "masses": [10.5, 3.6, 4.1, 3.6, 1.0, 0.2],
        "centres": [(0, 0.02, -0.04), (0.11, 0, 0.13), (0.01, 0.01, 0.04), (0, 0, -0.11), (0, 0, 0), (0, 0, 0.04)],
        "radii": [0.08, 0.06, 0.06, 0.05, 0.03, 0.02],
        "rotors": [0.35, 0.35, 0.1, 0.03, 0.04, 0.01],
        "viscous": [8.0, 5.5, 2.0, 1.1, 1.8, 0.65],
        "coulomb": [7.2, 8.3, 6.4, 2.5, 3.3, 0.3],
    },
    "UR3": {
        "joints": [(0, 0, 0.152), (0, HALF, 0), (-0.244, 0, 0), (-0.213, 0, 0.112), (0, HALF, 0.085), (0, -HALF, 0.082)],
        "masses": [2.0, 3.4, 1.3, 0.8, 0.8, 0.35],
        "centres": [(0, -0.02, 0), (-0.11, 0, 0.116), (-0.16, 0, 0.024), (0, 0.01, 0), (0, 0.01, 0), (0, 0, -0.02)],
        "radii": [0.05, 0.05, 0.04, 0.03, 0.03, 0.02],
        "rotors": [0.4, 0.4, 0.2, 0.05, 0.05, 0.05],
        "viscous": [4.0, 4.0, 2.0, 0.6, 0.6, 0.6],
        "coulomb": [3.0, 3.0, 1.5, 0.7, 0.7, 0.7],
    },
    "RV2SQ": {
        "joints": [(0, 0, 0.295), (0, -HALF, 0), (0.23, 0, 0), (0.05, -HALF, 0.27), (0, HALF, 0), (0, -HALF, 0.07)],
        "masses": [6.0, 4.5, 4.0, 1.5, 1.0, 0.15],
        "centres": [(0, 0.01, -0.05), (0.12, 0, 0.01), (0.02, 0, 0), (0, 0.01, -0.08), (0, -0.02, 0), (0, 0, 0.01)],
        "radii": [0.08, 0.06, 0.06, 0.04, 0.03, 0.02],
        "rotors": [0.3, 0.4, 0.15, 0.03, 0.03, 0.02],
        "viscous": [5.0, 6.0, 3.0, 0.6, 0.7, 0.5],
        "coulomb": [6.0, 7.0, 4.0, 1.0, 1.2, 0.6],
    },
}  # fmt: skip
"""Modified Denavit-Hartenberg a (m), alpha (rad), d (m); kg, m, radii of gyration in m, kg m^2, N m s/rad, N m."""

ARMS = tuple(_ARMS)


@dataclass(frozen=True)
class Recording:
    """Logs of one arm and reference that differ in their noise; arrays (n_logs, n_samples, n_dof) but for time."""

    time: np.ndarray
    positions: np.ndarray
    """What the encoders say, rad."""
    tau: np.ndarray
    """What the drives say, N m."""


@dataclass(frozen=True)
class _Motion:
    """Simulated motions, (n_motions, n_samples, n_dof) each."""

    q: np.ndarray
    tau: np.ndarray
    read: np.ndarray
    """Positions that the controller has seen."""


class ControlledArm:
    """An arm, its controller and its reference.

    Args:
        name: Name of the arm.
        seed: Seed of the reference.
    """

    def __init__(self, name: str, seed: int = 0) -> None:
        robot = _make_robot(name)
        self.mechanism: Mechanism = robot.build_mechanism()
        self.values = robot.get_values()
        self.dynamics = Dynamics(self.mechanism)
        self.base = find_base(self.dynamics, np.ones(self.mechanism.n_dof, dtype=bool))
        others = np.setdiff1d(np.arange(self.values.size), self.base.columns)
        self.true = self.values[self.base.columns] + self.base.beta @ self.values[others]
        self.time = np.arange(0, SECONDS, 1 / RATE)
        series = np.random.default_rng(seed).normal(size=(6, 1 + 2 * _HARMONICS))
        series[:, 0] *= 0.3
        basis = evaluate_basis(_PERIOD, _HARMONICS, self.time)
        self.reference = basis.evaluate(0.6 * series)
        M, _ = self.dynamics.compute_mass_matrix_and_bias(
            self.reference[0][::500], 0 * self.reference[0][::500], self.values
        )
        inertia = np.mean(np.diagonal(M, axis1=1, axis2=2), axis=0)
        self._stiffness, self._damping = _BANDWIDTH**2 * inertia, 2 * _BANDWIDTH * inertia

    @cached_property
    def _step(self) -> BatchFunction:
        """A function that returns positions and speeds after one control step, by a Runge-Kutta method at constant torque."""
        n, p = self.mechanism.n_q, self.mechanism.n_parameters
        sizes = {"q": n, "dq": n, "tau": n, "phi": p}
        q, dq, tau, phi = (ca.SX.sym(name, size) for name, size in sizes.items())
        M, delta = express_mass_matrix_and_bias(self.mechanism, q, dq, phi)
        D, LT, order = ca.ldl(ca.cse(M))
        ddq = ca.ldl_solve(tau - delta, D, LT, order)
        rates = ca.Function("rates", [q, dq, tau, phi], [dq, ddq])
        inputs = [ca.MX.sym(name, size) for name, size in sizes.items()]
        at, speed, *rest = inputs
        h = 1 / RATE
        a = rates(at, speed, *rest)
        b = rates(at + h / 2 * a[0], speed + h / 2 * a[1], *rest)
        c = rates(at + h / 2 * b[0], speed + h / 2 * b[1], *rest)
        d = rates(at + h * c[0], speed + h * c[1], *rest)
        ends = [x + h / 6 * (a[k] + 2 * b[k] + 2 * c[k] + d[k]) for k, x in enumerate((at, speed))]
        return BatchFunction(inputs, ends)

    def simulate(self, phi: np.ndarray, bits: int = 0) -> _Motion:
        """Return the motions of arms with some parameters, (n_motions, n_parameters); their encoders have different zeros."""
        n_motions = len(phi)
        wanted, speed, _ = self.reference
        shape = (n_motions, *wanted.shape)
        q, torques, read = (np.zeros(shape) for _ in range(3))
        step = 2 * np.pi / 2**bits if bits else 0.0
        shift = np.random.default_rng(1).uniform(size=(n_motions, wanted.shape[1])) * step
        at, rate = np.tile(wanted[0], (n_motions, 1)), np.tile(speed[0], (n_motions, 1))
        last, seen, before = at, rate, None
        share = 1 - np.exp(-_SPEED_FILTER / RATE)
        phi = np.ascontiguousarray(phi)
        for k in range(len(wanted)):
            position = np.floor((at + shift) / step) * step + step / 2 - shift if step else at
            if k:
                seen = seen + share * ((position - last) * RATE - seen)
            last = position
            tau = self._stiffness * (wanted[k] - position) + self._damping * (speed[k] - seen)
            # Drives report the mean of the torques before and after the sample, which has no delay.
            q[:, k], torques[:, k], read[:, k] = (
                at,
                tau if before is None else (tau + before) / 2,
                position,
            )
            before = tau
            at, rate = self._step(at, rate, tau, phi)
        return _Motion(q, torques, read)

    def record(self, draws: int) -> Recording:
        """Return logs of the arm that differ in their noise."""
        motion = self.simulate(np.tile(self.values, (draws, 1)), BITS)
        size = _NOISE * np.std(motion.tau[0], axis=0)
        noise = [coloured(motion.tau[0].shape, size, 0.0, seed) for seed in range(draws)]
        return Recording(self.time, motion.read, motion.tau + np.array(noise))

    def complete(self, parameters: np.ndarray) -> np.ndarray:
        """Return standard parameters that need the same torques as some base parameters, (n, n_parameters)."""
        phi = np.zeros((len(parameters), self.values.size))
        phi[:, self.base.columns] = parameters
        return phi


def _make_robot(name):
    arm = _ARMS[name]
    joints = [
        {"name": str(k + 1), "a": a, "alpha": alpha, "d": d}
        for k, (a, alpha, d) in enumerate(arm["joints"])
    ]
    bodies = {
        str(k + 1): {
            "m": m,
            "com": list(com),
            "inertia_com": [m * r**2, 0, 0, m * r**2, 0, m * r**2],
        }
        for k, (m, com, r) in enumerate(
            zip(arm["masses"], arm["centres"], arm["radii"], strict=True)
        )
    }
    drives = {
        f"z_{k + 1}": {"inertia": i, "viscous": v, "coulomb": c, "smoothing": 0.05}
        for k, (i, v, c) in enumerate(
            zip(arm["rotors"], arm["viscous"], arm["coulomb"], strict=True)
        )
    }
    return Robot(
        robot=name.lower(),
        description={"dh": {"convention": "modified", "joints": joints}},
        parameter_sets={"true": bodies},
        drives=drives,
    )
