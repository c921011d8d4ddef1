"""How often intervals hold the truth, and hints are right, on simulated logs: `make identification`.

The arm is that of puma560_friction.yaml, 20 s at 100 Hz; each log has a motion and noise of its own.
"""

import sys
import warnings

import numpy as np

from paramreduce_cli.identification.estimation import Rows, fit_weighted
from paramreduce_cli.identification.residual_hints import find_residual_hints
from paramreduce_cli.identification.torque_hints import hint_at_gravity, hint_at_unit
from paramreduce_cli.judgement.cross_validation import (
    choose_by_bounded_loss,
    choose_by_one_standard_error,
    cross_validate,
)
from paramreduce_cli.multibody.noise import estimate_joint_noise
from paramreduce_cli.multibody.observation import combine_factors
from paramreduce_cli.multibody.orthogonal import solve_least_squares
from paramreduce_cli.records import INERTIAL
from paramreduce_cli.reduction.criteria.torque import TorqueObjective
from paramreduce_cli.reduction.fitting import fit
from paramreduce_cli.reduction.problem import SelectionProblem
from paramreduce_cli.reduction.task import Effort, SelectionTask, run
from tests.benchmarks.estimators import (
    BaseModel,
    collect,
    factorise,
    fit_by_noise,
    print_estimators,
    process,
)
from tests.simulated_logs import RATE, along_axes, arm, coloured, record_encoder, simulated

_NOISE = 0.03
"""Standard deviation of the noise, a share of each joint's torques."""
_BITS = 19
"""Of the encoder that positions are recorded by."""
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
_LEARNED = 0.6
"""Share of a log that is learned from."""
_FOLDS = 5
_DRAWS = 25
"""Logs of the comparison of estimators, as BIRDy has."""
_MODEL_ERRORS = 24
_FIRST_SEED = 12
"""Logs of smaller seeds were looked at when the rule for the size was chosen."""
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


def fit_exact_states(log, tau):
    """Fit to all 20 s with the states of the simulation."""
    return fitted(log, tau, log.X)


def fit_recorded_positions(log, tau):
    """Fit to the first 12 s, states and cut-offs by the tool from positions of an encoder."""
    _, dynamics, base, _ = arm()
    model = BaseModel(dynamics, base.columns)
    return fit_by_noise(collect(model, process(model, record_encoder(log, tau, _BITS))))


def coverage(fit_log, pole, count):
    """Share of the true values within 95 % intervals; its extremes over parameters, and over logs."""
    hits = []
    for seed in range(count):
        log = simulated(seed)
        found = fit_log(log, noisy(log, log.tau, pole, seed))
        hits.append(np.abs(found.parameters - log.values) < found.compute_half_widths())
    by_parameter, by_log = np.mean(hits, axis=0), np.mean(hits, axis=1)
    return np.mean(hits), *(edge(part) for part in (by_parameter, by_log) for edge in (min, max))


def add_model_error(case, log, seed):
    """Torques with an effect that the model lacks; its size is that of the noise, or a fifth of a sampling step."""
    size = _NOISE * np.std(log.tau, axis=0)
    if case == "delay":
        return np.column_stack([np.interp(log.time - 0.2 / RATE, log.time, t) for t in log.tau.T])
    if case == "ripple":
        rng = np.random.default_rng([seed, 9])
        phase = rng.integers(20, 60) * log.z + rng.uniform(0, 2 * np.pi, log.z.shape[1])
        return log.tau + np.sqrt(2) * size * np.sin(phase)
    share = log.dz / np.abs(log.dz).max(axis=0)
    return log.tau + 3 * size * (np.tanh(100 * share) - np.tanh(10 * share))


def print_model_errors(count):
    print(
        f"{count} logs each, recorded positions, white noise: true values within 95 % intervals, logs with a hint"
    )
    for case in ("delay", "ripple", "stribeck"):
        hits, hinted = [], 0
        for seed in range(count):
            log = simulated(seed)
            fit = fit_recorded_positions(
                log, noisy(log, add_model_error(case, log, seed), 0.0, seed)
            )
            hits.append(np.abs(fit.parameters - log.values) < fit.compute_half_widths())
            hinted += bool(find_residual_hints(fit, log.names))
        print(f"  {case:8} {100 * np.mean(hits):.0f} %, {100 * hinted / count:.0f} %", flush=True)


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


def compare_sizes(pole, seed):
    """Number of parameters, and held-out error over that of all parameters, of both rules; 12 s learned from, 8 s held out."""
    mechanism, dynamics, _, _ = arm()
    log = simulated(seed)
    W = dynamics.compute_regressor(log.z, log.dz, log.ddz)
    tau = noisy(log, log.tau, pole, seed)
    border = int(_LEARNED * len(tau))
    factors, held_out = (
        factorise(W[:border], tau[:border], _FOLDS),
        factorise(W[border:], tau[border:], 1),
    )
    scale = np.sqrt(np.sum(factors[..., -1] ** 2, axis=(0, 2)) / border)
    deviation = estimate_joint_noise(factors, scale, border)
    whole = combine_factors(factors, deviation)
    candidates = np.flatnonzero(np.linalg.norm(whole[:, :-1], axis=0) > 1e-12)
    problem = SelectionProblem(whole[:, :-1], whole[:, -1], candidates, mechanism.preference_order)
    rank = int(np.linalg.matrix_rank(whole[:, candidates], rtol=1e-9))

    def select(other):
        effort = Effort(time_limit=10, node_limit=5000, subtrees=False, jobs=1)
        return run("swap", SelectionTask(TorqueObjective(other), rank, effort=effort)).subsets

    def error(subset):
        parameters = np.zeros(W.shape[2])
        parameters[subset] = fit(problem, subset).parameters
        left = held_out[..., -1] - held_out[..., :-1] @ parameters
        return np.linalg.norm(left)

    folds = [
        (
            combine_factors(np.delete(factors, k, 0), deviation),
            combine_factors(factors[[k]], deviation),
        )
        for k in range(_FOLDS)
    ]
    crossed = {"swap": cross_validate(problem, folds, select)}
    subsets = {subset.size: subset for subset in select(problem)}
    sizes = [choose(crossed).n for choose in (choose_by_bounded_loss, choose_by_one_standard_error)]
    return sizes, [error(subsets[n]) / error(candidates) for n in sizes]


def print_sizes(count):
    seeds = range(_FIRST_SEED, _FIRST_SEED + count)
    found = [compare_sizes(pole, seed) for pole in (0.0, 0.9) for seed in seeds]
    sizes, errors = (np.array(part) for part in zip(*found, strict=True))
    ratio = sizes[:, 0] / sizes[:, 1]
    print(f"{len(found)} logs: held-out error at most 5 % above that of all parameters")
    print(f"  bounded loss {100 * np.mean(errors[:, 0] <= 1.05):.0f} %, one standard error {100 * np.mean(errors[:, 1] <= 1.05):.0f} %; "
          f"parameters {ratio.mean():.2f} (at most {ratio.max():.2f}) times as many")  # fmt: skip


def main(logs=100, cases=100, sizes=22):
    warnings.simplefilter("ignore")
    print(f"{logs} simulated logs, {100 * _NOISE:g} % noise: true values within 95 % intervals")
    states = {"exact states, 20 s": fit_exact_states, "positions of 19 bits, 12 s": fit_recorded_positions}  # fmt: skip
    for name, fit_log in states.items():
        for pole in (0.0, 0.9, 0.95, 0.97):
            mean, least, most, worst, best = (100 * part for part in coverage(fit_log, pole, logs))
            print(f"  {name}, noise with a pole at {pole:<4}: {mean:.1f} % ({least:.0f} ... {most:.0f} % by parameter, "
                  f"{worst:.0f} ... {best:.0f} % by log)", flush=True)  # fmt: skip
    print(f"{cases} logs each: right hint first; for clean logs none at all")
    for case in ("clean", *_SAID):
        for pole in (0.0, 0.9):
            print(f"  {case:8} pole {pole}: {100 * right(case, pole, cases):.0f} %", flush=True)
    print_model_errors(_MODEL_ERRORS)
    print_estimators(_DRAWS)
    print_sizes(sizes)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
