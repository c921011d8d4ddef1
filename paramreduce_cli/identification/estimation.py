"""Parameters identified from measured torques, with standard deviations for coloured noise."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # its stats takes a third of a second to load, so only when it is used

from paramreduce_cli.identification.uncertainty import (
    ColouredNoise,
    add_lost_noise,
    compute_absorbed_noise,
    compute_score_covariance,
    count_degrees_of_freedom,
    count_effective_samples,
    estimate_autocovariance,
    fit_noise,
)
from paramreduce_cli.multibody.observation import append_rows
from paramreduce_cli.multibody.orthogonal import solve_least_squares
from paramreduce_cli.records import Block, FloatArray, Residuals

_MOST_SAMPLES = 40_000
"""That noise and standard deviations are taken from."""
_ROUNDS = 8
"""Iterations of the correction for the noise that the fit has absorbed."""
_SAME_STEP = 0.01
"""Relative error of a step between samples up to which a motion goes on, as folds of one piece do."""
_TUNING = 1.345
"""Huber's constant: residuals beyond so many deviations count less."""
_MOST_ROUNDS = 30
_SETTLED = 1e-6
_CONFIDENCE = 0.95
_UNDETERMINED = 1e-9
"""Singular value, relative to the largest of columns of unit length, from which on rows determine a direction."""
_LAGS = 10
"""Lags of the test of whiteness."""


@dataclass(frozen=True)
class Rows:
    """The rows of W for the columns of one model, with the torques, held in memory.

    Attributes:
        X: Columns of the model, one array (n_samples, n_dof, p) for each uninterrupted part.
        tau: Torques, one array (n_samples, n_dof) for each uninterrupted part.
        dz: Speeds, like tau.
        ddz: Accelerations, like tau.
        step: Step between samples, s.
        fraction: Fraction of all samples that these rows are.
    """

    X: tuple[FloatArray, ...]
    tau: tuple[FloatArray, ...]
    dz: tuple[FloatArray, ...]
    ddz: tuple[FloatArray, ...]
    step: float
    fraction: float

    @cached_property
    def n_samples(self) -> int:
        """Over all parts."""
        return sum(part.shape[0] for part in self.tau)


def collect_rows(
    blocks: Iterable[Block], columns: FloatArray, known_values: FloatArray, n_samples: int
) -> Rows:
    """Return the rows of a model, evenly spread over all trajectories if there are too many.

    Args:
        blocks: The samples.
        columns: Matrix that expresses the model's columns by those of the standard parameters, (n_standard, p).
        known_values: Standard parameters whose torques are subtracted, (n_standard,).
        n_samples: Number of samples.
    """
    fraction = min(1.0, _MOST_SAMPLES / n_samples)
    parts: list[list[tuple[FloatArray, ...]]] = []
    step = 0.0
    target = collected = 0.0
    previous = -np.inf
    for block in blocks:
        target += fraction * block.time.size
        if collected + 0.5 * block.time.size > target and fraction < 1.0:
            continue
        collected += block.time.size
        if step == 0.0 and block.time.size > 1:
            step = float(np.median(np.diff(block.time)))
        if not parts or abs(block.time[0] - previous - step) > _SAME_STEP * step:
            parts.append([])
        previous = block.time[-1]
        X = (block.W @ columns).reshape(*block.tau.shape, -1)
        tau = block.tau - (block.W @ known_values).reshape(block.tau.shape)
        parts[-1].append((X, tau, block.dz, block.ddz))
    joined = [tuple(map(np.concatenate, zip(*part, strict=True))) for part in parts]
    X, tau, dz, ddz = zip(*joined, strict=True)
    return Rows(X, tau, dz, ddz, step, sum(t.shape[0] for t in tau) / n_samples)


RowMaker = Callable[[], Iterable[tuple[FloatArray, FloatArray]]]
"""Yields the rows of a model and the torques of all samples, block by block, anew with every call."""


def fit_robustly(
    make: RowMaker, start: FloatArray, deviation: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Fit parameters by iteratively reweighted least squares with Huber's weights [Huber1964].

    Args:
        make: Function that yields (X, tau) blocks of all samples, (n, n_dof, p) and (n, n_dof), at each call.
        start: Start values of the parameters, (p,).
        deviation: Standard deviation of each joint's noise, (n_dof,); infinite where torques are not measured.

    Returns:
        The parameters, and the deviations of the bulk of the residuals.
    """
    parameters: FloatArray = start
    measured = np.isfinite(deviation)
    for _ in range(_MOST_ROUNDS):
        left = np.concatenate([np.abs(tau - X @ parameters) for X, tau in make()])
        deviation = np.where(measured, 1.4826 * np.median(left, axis=0), np.inf)
        deviation = np.maximum(deviation, 1e-12 * np.abs(left).max(initial=1e-300))
        factor = np.zeros((0, start.size + 1))
        for X, tau in make():
            size = np.abs(tau - X @ parameters) / deviation
            weight = np.sqrt(np.minimum(1.0, _TUNING / np.maximum(size, 1e-12))) / deviation
            stacked = np.concatenate([X, tau[..., None]], axis=2) * weight[..., None]
            factor = append_rows(factor, stacked.reshape(-1, start.size + 1))
        found = solve_least_squares(factor)
        change = np.linalg.norm(factor[:, :-1] @ (found - parameters))
        parameters = found
        if change <= _SETTLED * np.linalg.norm(factor[:, -1]):
            break
    return parameters, deviation


@dataclass(frozen=True)
class LinearFit:
    """A weighted least-squares fit and the statistics of its residuals.

    Attributes:
        rows: Rows of the model.
        parameters: Fitted parameters, (p,).
        deviation: Divisor of the torques of each joint, (n_dof,); infinite where not measured.
    """

    rows: Rows
    parameters: FloatArray
    deviation: FloatArray

    @cached_property
    def weights(self) -> FloatArray:
        """Weights of squared residuals, (n_dof,)."""
        return 1 / self.deviation**2

    @cached_property
    def _inverse_factors(self) -> tuple[FloatArray, FloatArray]:
        """Factors of the inverse of X' W X over the rows, with a large entry for each direction that no row determines.

        Returns:
            The factors of determined and of undetermined directions, (p, n) each.
        """
        scaled = [X / self.deviation[:, None] for X in self.rows.X]
        stacked = np.concatenate([X.reshape(-1, X.shape[2]) for X in scaled])
        R = np.linalg.qr(stacked, mode="r")
        lengths = np.linalg.norm(R, axis=0)
        lengths = np.where(lengths > 0, lengths, lengths.max() or 1.0)
        _, sizes, directions = np.linalg.svd(R / lengths)
        sizes = np.pad(sizes, (0, lengths.size - sizes.size))
        least = _UNDETERMINED * (sizes[0] or 1.0)
        factors = directions.T / lengths[:, None] / np.maximum(sizes, least)
        return factors[:, sizes > least], factors[:, sizes <= least]

    @cached_property
    def _inverse(self) -> FloatArray:
        """Inverse of X' W X over the rows, in the directions that these determine."""
        determined, _ = self._inverse_factors
        result: FloatArray = determined @ determined.T
        return result

    @cached_property
    def residuals(self) -> list[FloatArray]:
        """Residuals of the torques, (n_samples, n_dof) for each part."""
        pairs = zip(self.rows.X, self.rows.tau, strict=True)
        return [tau - X @ self.parameters for X, tau in pairs]

    def compute_residuals_of(self, noise: Sequence[FloatArray]) -> list[FloatArray]:
        """Return the residuals that other torques leave after a fit, (n_samples, n_dof) for each part."""
        score = sum(
            np.einsum("njp,nj->p", X, e * self.weights)
            for X, e in zip(self.rows.X, noise, strict=True)
        )
        fitted = self._inverse @ score
        return [e - X @ fitted for X, e in zip(self.rows.X, noise, strict=True)]

    @cached_property
    def noise(self) -> list[ColouredNoise]:
        """Coloured noise of each joint.

        The fit absorbs slow noise. The chosen model predicts residuals with the observed autocovariances.
        """
        n_dof, n = self.deviation.size, self.rows.n_samples
        seen = [estimate_autocovariance([e[:, j] for e in self.residuals]) for j in range(n_dof)]
        models = [fit_noise(a, n) for a in seen]
        for _ in range(_ROUNDS):
            lost = self.rows.fraction * compute_absorbed_noise(
                self.rows.X, models, self.weights, self._inverse, self._propagate_noise(models)
            )
            models = [fit_noise(add_lost_noise(a, b), n) for a, b in zip(seen, lost, strict=True)]
        return models

    def _propagate_noise(self, noise: Sequence[ColouredNoise]) -> FloatArray:
        """Return the covariance that noise of each joint gives the parameters fitted to these rows, (p, p)."""
        scores = compute_score_covariance(self.rows.X, noise, self.weights)
        result: FloatArray = self._inverse @ scores @ self._inverse
        return result

    def compute_covariance(self) -> FloatArray:
        """Return the covariance of the parameters, (p, p)."""
        return self._covariance

    @cached_property
    def _covariance(self) -> FloatArray:
        """Covariance of the parameters, (p, p)."""
        _, undetermined = self._inverse_factors
        determined = self._propagate_noise(self.noise) * self.rows.fraction
        return determined + undetermined @ undetermined.T

    def compute_half_widths(self) -> FloatArray:
        """Return the half widths of the intervals that hold the true parameters in 95 of 100 cases, (p,).

        The noise is known from few frequencies if the motion is slow and short, so Student's t distribution is used.
        """
        freedom = count_degrees_of_freedom(self.rows.X, self.noise, self.weights, self._inverse)
        deviations = np.sqrt(np.maximum(0.0, np.diag(self.compute_covariance())))
        result: FloatArray = scipy.stats.t.ppf(0.5 + _CONFIDENCE / 2, freedom) * deviations
        return result

    def analyse_residuals(self, n_samples: int) -> Residuals:
        """Return the statistics of the residuals.

        Args:
            n_samples: Number of samples of the whole training data.
        """
        every = np.concatenate(self.residuals)
        lag_one, white = [], []
        for j in range(self.deviation.size):
            covariance = estimate_autocovariance([e[:, j] for e in self.residuals])
            correlation = covariance / max(covariance[0], 1e-300)
            lags = np.arange(1, min(_LAGS, covariance.size - 1) + 1)
            n = every.shape[0]
            statistic = n * (n + 2) * np.sum(correlation[lags] ** 2 / (n - lags))
            lag_one.append(correlation[1] if correlation.size > 1 else 0.0)
            white.append(scipy.stats.chi2.sf(statistic, max(1, lags.size)))
        unknown = np.where(np.isfinite(self.deviation), 1.0, np.nan)
        return Residuals(
            deviation=np.std(every, axis=0) * unknown,
            lag_one=np.array(lag_one) * unknown,
            effective_samples=np.array([count_effective_samples(m, n_samples) for m in self.noise])
            * unknown,
            white=np.array(white) * unknown,
        )


def fit_weighted(rows: Rows, deviation: FloatArray) -> LinearFit:
    """Fit a model's parameters by weighted least squares.

    Args:
        rows: Rows of the model.
        deviation: Divisor of the torques of each joint, (n_dof,); infinite where not measured.
    """
    X = np.concatenate([(x / deviation[:, None]).reshape(-1, x.shape[2]) for x in rows.X])
    y = np.concatenate([(t / deviation).ravel() for t in rows.tau])
    return LinearFit(rows, solve_least_squares(np.column_stack([X, y])), deviation)
