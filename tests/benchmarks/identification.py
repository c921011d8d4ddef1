"""How often intervals hold the truth, and hints are right, on simulated logs: `make identification`.

The arm is that of puma560_friction.yaml, 20 s at 100 Hz; each log has a motion and noise of its own.
"""

import sys
import warnings

import numpy as np

from paramreduce_cli.identification.estimation import Rows, fit_weighted
from paramreduce_cli.identification.residual_hints import find_residual_hints
from paramreduce_cli.identification.torque_hints import hint_at_gravity, hint_at_unit
from paramreduce_cli.multibody.orthogonal import solve_least_squares
from paramreduce_cli.records import INERTIAL
from tests.simulated_logs import RATE, along_axes, arm, coloured, simulated

_NOISE = 0.03
"""Standard deviation of the noise, a share of each joint's torques."""
_LEFT_OUT = {"coulomb": "fc", "viscous": "fv", "inertia": "Ia"}
_SAID = {
    "unit": "in another unit",
    "all signs": "the wrong sign",
    "gravity": "is description.gravity right",
    "delay": "ms later than positions",
    "sign": "sampling.log.signs",
    "gain": "times what those of the other joints let expect",
    "coulomb": "coulomb is missing",
    "viscous": "viscous is missing",
    "inertia": "inertia is missing",
}
_EVERY = 10
"""Samples of which one is looked at for what is of all torques together."""
_SHARED = 3
"""Joints whose torques share parameters with others, so that their scale can be told."""


def fitted(log, tau, X):
    rows = Rows((X,), (tau,), (log.dz,), (log.ddz,), 1 / RATE, 1.0)
    deviation = np.std(tau, axis=0)
    for _ in range(4):
        left = fit_weighted(rows, deviation).residuals[0]
        deviation = np.maximum(np.std(left, axis=0), 1e-9)
    return fit_weighted(rows, deviation)


def noisy(log, tau, pole, seed):
    return tau + coloured(tau.shape, _NOISE * np.std(log.tau, axis=0), pole, seed)


def coverage(pole, count):
    """Share of the true values within 1.96 standard deviations, and its extremes over parameters."""
    hits = []
    for seed in range(count):
        log = simulated(seed)
        found = fitted(log, noisy(log, log.tau, pole, seed), log.X)
        deviations = np.sqrt(np.diag(found.compute_covariance()))
        hits.append(np.abs(found.parameters - log.values) < 1.96 * deviations)
    return np.mean(hits), np.mean(hits, axis=0).min(), np.mean(hits, axis=0).max()


def changed(case, log, seed):
    """Torques and columns with something wrong."""
    rng = np.random.default_rng([seed, 7])
    tau, X = log.tau.copy(), log.X
    if case == "delay":
        tau = np.column_stack([np.interp(log.time - 0.01, log.time, t) for t in tau.T])
    elif case == "sign":
        tau[:, rng.integers(tau.shape[1])] *= -1
    elif case == "gain":
        tau[:, rng.integers(_SHARED)] *= rng.choice([0.8, 1.2, 1.5])
    elif case == "all signs":
        tau *= -1
    elif case == "unit":
        tau *= rng.choice([1000, 1 / 9.81, 0.05])
    elif case == "gravity":
        _, pulls = along_axes(log.z, log.dz, log.ddz)
        mechanism, _, _, values = arm()
        axis = np.array([[0, 0, 1], [1, 0, 0], [0, -1, 0]])[rng.integers(3)]
        size = np.linalg.norm(mechanism.gravity)
        tau += np.tensordot(size * axis - mechanism.gravity, pulls, axes=1) @ values
    elif case in _LEFT_OUT:
        X = X[:, :, [kind != _LEFT_OUT[case] for kind in log.kinds]]
    return tau, X


def list_hints(case, log, tau, deviation):
    """What is said of all torques together: by all standard columns, and by the bodies' known values."""
    mechanism, _, _, values = arm()
    some = slice(None, None, _EVERY)
    W, pulls = along_axes(log.z[some], log.dz[some], log.ddz[some])
    kept = [p.kind.symbol != _LEFT_OUT.get(case) for p in mechanism.parameters]
    W, pulls = W * kept, pulls * kept
    bodies = [k for k, p in enumerate(mechanism.parameters) if p.kind in INERTIAL]
    rows = (W / deviation[:, None]).reshape(-1, W.shape[2])
    standard = solve_least_squares(np.column_stack([rows, (tau[some] / deviation).ravel()]))
    yield from hint_at_gravity(W, pulls, tau[some], deviation, mechanism.gravity)
    yield from hint_at_unit(W[:, :, bodies] @ values[bodies], W[:, :, bodies] @ standard[bodies])


def right(case, pole, count):
    """Share of logs whose first hint is the right one; of none where nothing is wrong."""
    good = 0
    for seed in range(count):
        log = simulated(seed)
        tau, X = changed(case, log, seed)
        tau = noisy(log, tau, pole, seed)
        fit = fitted(log, tau, X)
        found = [*list_hints(case, log, tau, fit.deviation), *find_residual_hints(fit, log.names)]
        good += (
            _SAID[case] in found[0] if case in _SAID and found else case == "clean" and not found
        )
    return good / count


def main(logs=200, cases=100):
    warnings.simplefilter("ignore")
    print(f"{logs} simulated logs, {100 * _NOISE:g} % noise: true values within 95 % intervals")
    for pole in (0.0, 0.9, 0.97):
        mean, least, most = coverage(pole, logs)
        print(f"  noise with a pole at {pole:<4}: {100 * mean:.1f} % ({100 * least:.0f} ... {100 * most:.0f} % "
              "by parameter)", flush=True)  # fmt: skip
    print(f"{cases} logs each: right hint first; for clean logs none at all")
    for case in ("clean", *_SAID):
        for pole in (0.0, 0.9):
            print(f"  {case:8} pole {pole}: {100 * right(case, pole, cases):.0f} %", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
