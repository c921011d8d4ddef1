"""Estimators beside each other, with good and poor filters, on simulated logs: part of `make identification`.

The protocol is that of BIRDy in short: torques with noise, positions from an encoder, one filter that suits and one that does
not. Instruments are made of the exact motion, which no real log has: they bound what instrumental variables can reach.
"""

import time

import numpy as np

from paramreduce_cli.config.log_settings import LogSection
from paramreduce_cli.identification.band_scoring import make_column_function
from paramreduce_cli.identification.estimation import collect_rows, fit_robustly, fit_weighted
from paramreduce_cli.identification.measured_samples import LoggedSet
from paramreduce_cli.identification.processing import process_logs
from paramreduce_cli.multibody.noise import estimate_joint_noise
from tests.simulated_logs import arm, coloured, record_encoder, simulated

_NOISE = 0.03
_BITS = 14
_LEARNED = 0.6
"""Share of a log that is learned from; torques are predicted on the rest."""
_FILTERS = {
    "chosen by the tool": {},
    "poor (20 Hz, torques unfiltered)": {"state_cutoff": 20.0, "torque_cutoff": "none"},
}


def process(log, tau, bits, **cutoffs):
    """The log as the tool sees it; positions are exact if there are no bits."""
    _, dynamics, base, _ = arm()
    section = LogSection(files="log.csv", held_out=1 - _LEARNED, **cutoffs)
    columns_of = make_column_function(dynamics, np.array(base.columns))
    return process_logs(
        record_encoder(log, tau, bits), section, log.names, compute_columns=columns_of
    )


def collect(log):
    """Rows of the training part for the base parameters."""
    _, dynamics, base, _ = arm()
    samples = LoggedSet(log.training, log, dynamics, "log.csv")
    columns = np.eye(dynamics.mechanism.n_parameters)[:, base.columns]
    return collect_rows(
        samples.iterate_blocks(), columns, np.zeros(len(columns)), samples.n_samples
    )


def factorise(W, tau, folds):
    n = len(tau)
    return np.array(
        [
            [np.linalg.qr(np.column_stack([W[rows, j], tau[rows, j]]), mode="r") for j in range(tau.shape[1])]
            for rows in (slice(k * n // folds, (k + 1) * n // folds) for k in range(folds))
        ]
    )  # fmt: skip


def fit_by_noise(rows):
    """Weighted fit; each joint's weight is that of its noise."""
    X, tau = np.concatenate(rows.X), np.concatenate(rows.tau)
    scale = np.sqrt(np.mean(tau**2, axis=0))
    return fit_weighted(rows, estimate_joint_noise(factorise(X, tau, 1), scale, len(tau)))


def fit_total(X, tau, deviation):
    """Total least squares: columns of unit length are as wrong as the torques."""
    A = (X / deviation[:, None]).reshape(-1, X.shape[2])
    b = (tau / deviation).ravel()
    lengths = np.linalg.norm(A, axis=0)
    v = np.linalg.svd(np.column_stack([A / lengths, b / np.linalg.norm(b)]))[2][-1]
    return -v[:-1] / v[-1] * np.linalg.norm(b) / lengths


def fit_all(rows, instruments):
    """Parameters and seconds of each estimator."""
    X, tau = np.concatenate(rows.X), np.concatenate(rows.tau)
    Z = np.concatenate(instruments.X)
    fit = fit_by_noise(rows)
    weighted, deviation = fit.parameters, fit.deviation

    def fit_instrumental():
        weights = 1 / deviation**2
        gram = np.einsum("njp,j,njq->pq", Z, weights, X)
        return np.linalg.solve(gram, np.einsum("njp,j,nj->p", Z, weights, tau))

    estimators = {
        "ordinary": lambda: fit_weighted(rows, np.ones_like(deviation)).parameters,
        "weighted": lambda: fit_weighted(rows, deviation).parameters,
        "robust": lambda: fit_robustly(lambda: [(X, tau)], weighted, deviation)[0],
        "total": lambda: fit_total(X, tau, deviation),
        "instrumental, exact motion": fit_instrumental,
    }
    results = {}
    for name, estimate in estimators.items():
        begun = time.perf_counter()
        results[name] = estimate(), time.perf_counter() - begun
    return results


def print_estimators(draws):
    print(f"{draws} logs, {_BITS}-bit encoder: error of parameters in standard deviations of the weighted fit with chosen filters; "
          "error of held-out torques; time relative to weighted")  # fmt: skip
    table = {}
    for seed in range(draws):
        log = simulated(seed)
        tau = log.tau + coloured(log.tau.shape, _NOISE * np.std(log.tau, axis=0), 0.0, seed)
        held_out = slice(int(_LEARNED * len(tau)), None)
        unit = None
        for name, cutoffs in _FILTERS.items():
            processed = process(log, tau, _BITS, **cutoffs)
            same = {
                "state_cutoff": processed.state_cutoff,
                "torque_cutoff": processed.torque_cutoff,
            }
            same = {key: value if np.isfinite(value) else "none" for key, value in same.items()}
            rows = collect(processed)
            exact = collect(process(log, tau, 0, **same))
            fits = fit_all(rows, exact)
            if unit is None:
                unit = np.sqrt(np.diag(fit_by_noise(rows).compute_covariance()))
            for estimator, (values, seconds) in fits.items():
                wrong = log.X[held_out] @ (values - log.values)
                table.setdefault((name, estimator), []).append(
                    [
                        np.sqrt(np.mean(((values - log.values) / unit) ** 2)),
                        np.linalg.norm(wrong) / np.linalg.norm(log.tau[held_out]),
                        seconds / fits["weighted"][1],
                    ]
                )
    for (name, estimator), entries in table.items():
        error, torque, seconds = np.median(entries, axis=0)
        print(f"  {name:33} {estimator:27} {error:6.2f}  {100 * torque:7.3f} %  {seconds:5.1f}", flush=True)  # fmt: skip
