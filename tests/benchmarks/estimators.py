"""Estimators beside each other on arms under PD control, with good and poor filters: part of `make identification`.

Instrumental variables (IDIM-IV) and the direct and inverse model (DIDIM) simulate the closed loop with the parameters they have
found, starting from those of weighted least squares. They know the controller and its reference, which few logs tell.
"""

import time
from typing import NamedTuple

import numpy as np

from paramreduce_cli.config.log_settings import LogSection
from paramreduce_cli.identification.band_scoring import make_column_function
from paramreduce_cli.identification.estimation import collect_rows, fit_robustly, fit_weighted
from paramreduce_cli.identification.measured_samples import LoggedSet
from paramreduce_cli.identification.processing import process_logs
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.noise import estimate_joint_noise
from tests.benchmarks.closed_loop import ARMS, ControlledArm
from tests.simulated_logs import make_recording

_LEARNED = 0.6
"""Share of a log that is learned from."""
_FILTERS = {
    "chosen by the tool": {},
    "poor (50 Hz, torques unfiltered)": {"state_cutoff": 50.0, "torque_cutoff": "none"},
}
_SIMULATIONS = 4
"""Simulations of the closed loop that an estimate takes."""


class BaseModel(NamedTuple):
    """The dynamics of an arm, and the columns of its base parameters."""

    dynamics: Dynamics
    columns: np.ndarray


def process(model, logs, **cutoffs):
    """Logs as the tool sees them."""
    section = LogSection(files="log.csv", held_out=1 - _LEARNED, **cutoffs)
    names = model.dynamics.mechanism.coordinate_names
    columns_of = make_column_function(model.dynamics, np.array(model.columns))
    return process_logs(logs, section, names, compute_columns=columns_of)


def collect(model, log):
    """Rows of the training part for the base parameters."""
    samples = LoggedSet(log.training, log, model.dynamics, "log.csv")
    columns = np.eye(model.dynamics.mechanism.n_parameters)[:, model.columns]
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
    R = np.linalg.qr(np.column_stack([A / lengths, b / np.linalg.norm(b)]), mode="r")
    v = np.linalg.svd(R)[2][-1]
    return -v[:-1] / v[-1] * np.linalg.norm(b) / lengths


def fit_instrumental(X, tau, Z, deviation):
    """Instrumental variables: residuals that have nothing in common with the columns of a simulation."""
    weights = 1 / deviation**2
    gram = np.einsum("njp,j,njq->pq", Z, weights, X)
    return np.linalg.solve(gram, np.einsum("njp,j,nj->p", Z, weights, tau))


def fit_simulated(X, tau, Z, deviation):
    """Least squares with the columns of a simulation, whose torques are to be those of the log."""
    return fit_instrumental(Z, tau, Z, deviation)


class _Logs:
    """The rows of several logs of one arm for one filter, and estimates from them."""

    def __init__(self, arm, recording, cutoffs):
        self.arm, self.time = arm, recording.time
        self.model = BaseModel(arm.dynamics, arm.base.columns)
        pairs = list(zip(recording.positions, recording.tau, strict=True))
        first = process(self.model, make_recording(self.time, *pairs[0]), **cutoffs)
        chosen = {"state_cutoff": first.state_cutoff, "torque_cutoff": first.torque_cutoff}
        self.cutoffs = {k: v if np.isfinite(v) else "none" for k, v in chosen.items()}
        self.rows = [self.collect(*pair) for pair in pairs]
        self.fits = [fit_by_noise(rows) for rows in self.rows]

    def collect(self, positions, tau):
        logs = make_recording(self.time, positions, tau)
        return collect(self.model, process(self.model, logs, **self.cutoffs))

    def fit_directly(self, estimate):
        """Estimates of a function of columns, torques and deviations, and seconds of each."""
        start = time.perf_counter()
        values = [
            estimate(rows, np.concatenate(rows.X), np.concatenate(rows.tau), fit.deviation)
            for rows, fit in zip(self.rows, self.fits, strict=True)
        ]
        return np.array(values), (time.perf_counter() - start) / len(values)

    def fit_by_reference(self):
        """Instrumental variables whose instruments are the columns of the commanded motion."""
        commands = self.arm.reference[0]
        Z = np.concatenate(self.collect(commands, np.ones_like(commands)).X)  # torques do not enter
        return self.fit_directly(
            lambda rows, X, tau, deviation: fit_instrumental(X, tau, Z, deviation)
        )

    def fit_by_simulation(self, estimate):
        """Estimates of a function that also takes the columns of a simulation; not a number where that diverges."""
        start = time.perf_counter()
        values = np.array([fit.parameters for fit in self.fits])
        for _ in range(_SIMULATIONS):
            motion = self.arm.simulate(self.arm.complete(values))
            for k, rows in enumerate(self.rows):
                if not np.isfinite(motion.q[k]).all() or np.abs(motion.q[k]).max() > 100:
                    values[k] = np.nan
                    continue
                Z = np.concatenate(self.collect(motion.q[k], motion.tau[k]).X)
                X, tau = np.concatenate(rows.X), np.concatenate(rows.tau)
                values[k] = estimate(X, tau, Z, self.fits[k].deviation)
        return values, (time.perf_counter() - start) / len(values)


_DIRECT = {
    "ordinary": lambda rows, X, tau, deviation: fit_weighted(rows, np.ones_like(deviation)).parameters,
    "weighted": lambda rows, X, tau, deviation: fit_weighted(rows, deviation).parameters,
    "robust": lambda rows, X, tau, deviation: fit_robustly(
        lambda: [(X, tau)], fit_weighted(rows, deviation).parameters, deviation
    )[0],
    "total": lambda rows, X, tau, deviation: fit_total(X, tau, deviation),
}  # fmt: skip
_SIMULATED = {"instrumental (IDIM-IV)": fit_instrumental, "simulated (DIDIM)": fit_simulated}


def print_estimators(draws):
    print(f"{draws} logs of arms under PD control: error of parameters in standard deviations of the weighted fit with chosen filters; "
          "error of torques along another reference; seconds; estimates that diverge")  # fmt: skip
    for name in ARMS:
        arm, other = ControlledArm(name), ControlledArm(name, seed=1)
        recording = arm.record(draws)
        W = arm.dynamics.compute_regressor(*(part[::10] for part in other.reference))[
            ..., arm.base.columns
        ]
        unit = None
        for label, cutoffs in _FILTERS.items():
            logs = _Logs(arm, recording, cutoffs)
            if unit is None:
                unit = np.sqrt(
                    np.mean([np.diag(fit.compute_covariance()) for fit in logs.fits], axis=0)
                )
            print(f"  {name}, {label}: {logs.cutoffs}")
            fits = {key: logs.fit_directly(estimate) for key, estimate in _DIRECT.items()}
            fits["instrumental, commands"] = logs.fit_by_reference()
            fits |= {key: logs.fit_by_simulation(estimate) for key, estimate in _SIMULATED.items()}
            for key, (values, seconds) in fits.items():
                good = np.isfinite(values).all(axis=1)
                wrong = values[good] - arm.true
                error = np.median(np.sqrt(np.mean((wrong / unit) ** 2, axis=1)))
                torque = np.median(np.linalg.norm(W @ wrong.T, axis=(0, 1))) / np.linalg.norm(
                    W @ arm.true
                )
                print(f"    {key:24} {error:7.2f}  {100 * torque:7.3f} %  {seconds:7.3f} s  {np.count_nonzero(~good)}", flush=True)  # fmt: skip
