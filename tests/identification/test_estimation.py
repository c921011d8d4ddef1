import re

import numpy as np
import pytest
from simulated_logs import RATE, coloured, simulated

from paramreduce_cli.identification.estimation import (
    LinearFit,
    Rows,
    collect_rows,
    fit_robustly,
    fit_weighted,
)
from paramreduce_cli.identification.residual_hints import (
    find_residual_hints,
    hint_at_negative_friction,
)
from paramreduce_cli.identification.uncertainty import (
    ColouredNoise,
    compute_absorbed_noise,
    compute_score_covariance,
    count_degrees_of_freedom,
)
from paramreduce_cli.records import Block


def rows_of(log, tau, X=None):
    return Rows((log.X if X is None else X,), (tau,), (log.dz,), (log.ddz,), 1 / RATE, 1.0)


def fitted(log, tau, X=None):
    """Weighted by what is left, as a user would have it."""
    rows, deviation = rows_of(log, tau, X), np.std(tau, axis=0)
    for _ in range(4):
        left = fit_weighted(rows, deviation).residuals[0]
        deviation = np.maximum(np.std(left, axis=0), 1e-9)
    return fit_weighted(rows, deviation)


def test_exact_torques_give_exact_values():
    log = simulated(0)
    found = fit_weighted(rows_of(log, log.tau), np.std(log.tau, axis=0))
    assert np.allclose(
        found.parameters, log.values, rtol=1e-7, atol=1e-8 * np.abs(log.values).max()
    )


def test_the_covariance_of_scores_by_brute_force():
    """X' V X with the Toeplitz matrix of an autoregressive process written out."""
    rng = np.random.default_rng(0)
    X, pole, weights = rng.normal(size=(60, 2, 3)), 0.7, np.array([2.0, 0.5])
    noise = [ColouredNoise(np.array([pole]), 1.5), ColouredNoise(np.zeros(0), 0.3)]
    lags = np.abs(np.subtract.outer(np.arange(60), np.arange(60)))
    V = [1.5 / (1 - pole**2) * pole**lags, 0.3 * np.eye(60)]
    expected = sum(weights[j] ** 2 * X[:, j].T @ V[j] @ X[:, j] for j in range(2))
    assert np.allclose(compute_score_covariance([X], noise, weights), expected, rtol=1e-9)


def test_the_noise_that_a_fit_absorbs_by_brute_force():
    """Autocovariances of e minus those of (I - H) e, with H and the covariance of e written out."""
    rng = np.random.default_rng(1)
    n, pole, weights = 40, 0.8, np.array([2.0, 0.5])
    X = rng.normal(size=(n, 2, 3))
    noise = [ColouredNoise(np.array([pole]), 1.5), ColouredNoise(np.zeros(0), 0.3)]
    lags = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    V = np.zeros((2 * n, 2 * n))
    V[:n, :n], V[n:, n:] = 1.5 / (1 - pole**2) * pole**lags, 0.3 * np.eye(n)
    A, W = np.concatenate([X[:, 0], X[:, 1]]), np.diag(np.repeat(weights, n))
    inverse = np.linalg.inv(A.T @ W @ A)
    gain = inverse @ A.T @ W
    covariance = gain @ V @ gain.T
    left = np.eye(2 * n) - A @ gain
    lost = V - left @ V @ left.T
    expected = [
        [np.trace(lost[j * n : (j + 1) * n, j * n : (j + 1) * n], k) / n for k in range(5)]
        for j in range(2)
    ]
    found = compute_absorbed_noise([X], noise, weights, inverse, covariance)
    assert np.allclose(found[:, :5], expected, atol=1e-9)


def test_degrees_of_freedom_follow_from_how_broad_a_signal_is():
    """A harmonic depends on the noise at one frequency, with two degrees of freedom (three as its duration is finite)."""
    n = 512
    noise, one = [ColouredNoise(np.zeros(0), 2.0)], np.ones(1)
    harmonic = np.cos(2 * np.pi * 8 * np.arange(n) / n)[:, None, None]
    broad = np.random.default_rng(2).normal(size=(n, 1, 1))
    slow = count_degrees_of_freedom([harmonic], noise, one, np.eye(1) / np.sum(harmonic**2))
    fast = count_degrees_of_freedom([broad], noise, one, np.eye(1) / np.sum(broad**2))
    assert 2 <= slow <= 3.01
    assert 0.3 * n < fast < n


def test_folds_of_one_motion_are_joined():
    log = simulated(7)
    n = log.time.size
    borders = [slice(0, 500), slice(500, 1200), slice(1300, n)]
    blocks = [
        Block(k, *(part[rows] for part in (log.time, log.z, log.dz, log.ddz)),
              *(part[rows] for part in (log.z, log.dz, log.ddz)),
              log.tau[rows], log.X[rows].reshape(-1, log.X.shape[2]))
        for k, rows in enumerate(borders)
    ]  # fmt: skip
    p = log.X.shape[2]
    rows = collect_rows(blocks, np.eye(p), np.zeros(p), n - 100)
    assert [len(part) for part in rows.tau] == [1200, n - 1300]
    assert rows.step == pytest.approx(1 / RATE)


@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_intervals_hold_the_truth(pole):
    """Of few logs; `make identification` does it with a hundred."""
    hits = []
    for seed in range(8):
        log = simulated(seed)
        tau = log.tau + coloured(log.tau.shape, 0.05 * np.std(log.tau, axis=0), pole, seed)
        found = fitted(log, tau)
        hits.append(np.abs(found.parameters - log.values) < found.compute_half_widths())
    assert 0.90 < np.mean(hits) < 0.985


def test_deviations_for_white_noise_would_be_far_too_small():
    log = simulated(3)
    size = 0.05 * np.std(log.tau, axis=0)
    found = fitted(log, log.tau + coloured(log.tau.shape, size, 0.9, 3))
    X = (log.X / found.deviation[:, None]).reshape(-1, log.X.shape[2])
    white = np.sqrt(np.diag(np.linalg.inv(X.T @ X)))
    assert np.median(np.sqrt(np.diag(found.compute_covariance())) / white) > 2
    assert np.all(found.analyse_residuals(log.time.size).white < 1e-6)


def test_white_residuals_are_called_white():
    log = simulated(4)
    size = 0.05 * np.std(log.tau, axis=0)
    found = fitted(log, log.tau + coloured(log.tau.shape, size, 0.0, 4))
    judged = found.analyse_residuals(log.time.size)
    assert np.all(judged.white > 1e-3)
    assert np.allclose(judged.deviation, size, rtol=0.1)


def test_robust_values_withstand_outliers():
    log = simulated(5)
    rng = np.random.default_rng(5)
    size = 0.02 * np.std(log.tau, axis=0)
    tau = log.tau + size * rng.normal(size=log.tau.shape)
    bad = rng.random(tau.shape) < 0.05
    tau += bad * 60 * size * rng.normal(size=tau.shape)
    plain = fitted(log, tau)
    values, _ = fit_robustly(lambda: [(log.X, tau)], plain.parameters, plain.deviation)
    scale = np.linalg.norm(log.X.reshape(-1, log.X.shape[2]), axis=0)

    def miss(found):
        return np.linalg.norm(scale * (found - log.values))

    assert miss(values) < 0.3 * miss(plain.parameters)


def test_joints_without_torques_do_not_count():
    log = simulated(6)
    deviation = np.std(log.tau, axis=0)
    deviation[2] = np.inf
    tau = log.tau.copy()
    tau[:, 2] = 0.0
    found = LinearFit(
        rows_of(log, tau), fit_weighted(rows_of(log, tau), deviation).parameters, deviation
    )
    assert np.isnan(found.analyse_residuals(10).deviation[2])
    assert np.all(np.isfinite(np.diag(found.compute_covariance())))


def late(log, seconds):
    return np.column_stack([np.interp(log.time - seconds, log.time, t) for t in log.tau.T])


def flipped(log, joint):
    tau = log.tau.copy()
    tau[:, joint] *= -1
    return tau


def scaled(log, joint, gain):
    tau = log.tau.copy()
    tau[:, joint] *= gain
    return tau


CASES = {
    "delay": (lambda log: late(log, 0.01), None, r"Torques come (9|10|11)\S* ms later"),
    "sign": (lambda log: flipped(log, 1), None, "sampling.log.signs"),
    "gain": (lambda log: scaled(log, 1, 1.2), None, r"z_2 are 1\.(1[5-9]|2)"),
    "coulomb": (None, "fc", "coulomb is missing"),
    "viscous": (None, "fv", "viscous is missing"),
    "inertia": (None, "Ia", "inertia is missing"),
}


@pytest.mark.parametrize("case", list(CASES))
@pytest.mark.parametrize("seed", [0, 1])
def test_hints(case, seed):
    change, left_out, said = CASES[case]
    log = simulated(seed)
    tau = log.tau if change is None else change(log)
    tau = tau + coloured(tau.shape, 0.03 * np.std(log.tau, axis=0), 0.9, seed)
    X = log.X if left_out is None else log.X[:, :, [kind != left_out for kind in log.kinds]]
    assert any(
        re.search(said, text) for text in find_residual_hints(fitted(log, tau, X), log.names)
    )


@pytest.mark.parametrize("pole", [0.0, 0.9])
@pytest.mark.parametrize("seed", [0, 1])
def test_no_hints_where_nothing_is_wrong(pole, seed):
    log = simulated(seed)
    tau = log.tau + coloured(log.tau.shape, 0.03 * np.std(log.tau, axis=0), pole, seed)
    assert find_residual_hints(fitted(log, tau), log.names) == []


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ([1.0, 2.0, 0.5, 0.1], None),
        ([1.0, -0.04, 0.5, 0.1], None),  # not surely
        ([1.0, 2.0, -0.5, 0.1], "Friction of b comes out negative (fv_b = -0.5)"),
        ([-1.0, 2.0, -0.5, 0.1], "the sign of all torques"),
    ],
)
def test_friction_that_drives(values, said):
    found = hint_at_negative_friction(["fc_a", "fv_a", "fv_b", "fc_c"], list("aabc"), np.array(values), np.full(4, 0.01))  # fmt: skip
    assert found == [] if said is None else said in found[0]


def test_gravity_that_is_tilted_is_suspected():
    log = simulated(2)
    from simulated_logs import tilt_torques

    tilts = tilt_torques(2)
    tau = log.tau + 0.5 * tilts[0] + coloured(log.tau.shape, 0.02 * np.std(log.tau, axis=0), 0.5, 2)
    found = find_residual_hints(fitted(log, tau), log.names, [(t,) for t in tilts])
    assert any("Gravity seems to have 0.5" in text and "along x" in text for text in found)


def test_what_is_modelled_is_of_another_form_if_anything():
    log = simulated(0)
    X = log.X[:, :, [kind != "fc" for kind in log.kinds]]
    found = find_residual_hints(fitted(log, log.tau, X), log.names, modelled=[f"drives.{n}.coulomb" for n in log.names])  # fmt: skip
    assert any("coulomb is of another form" in text for text in found)
    assert not any("missing" in text for text in found)


def test_smoothing_that_the_log_has_decided_is_not_hinted_at():
    """Friction with a smooth sign that the model lacks."""
    log = simulated(9)
    speed = log.dz[:, 0] / (0.05 * np.abs(log.dz[:, 0]).max())
    tau = log.tau.copy()
    tau[:, 0] += 0.2 * np.std(tau[:, 0]) * (np.tanh(speed) - np.sign(speed))
    fit = fitted(log, tau + coloured(tau.shape, 0.01 * np.std(log.tau, axis=0), 0.0, 9))
    assert any("smoothing" in text for text in find_residual_hints(fit, log.names))
    tuned = find_residual_hints(fit, log.names, tuned=log.names[:1])
    assert not any("smoothing" in text for text in tuned)
