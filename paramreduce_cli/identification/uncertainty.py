"""Uncertainty of estimated parameters if the noise of the torques is coloured.

Residuals of a fast log follow one another closely, so that many samples say little more than a
few; standard deviations for white noise are then several times too small. The noise of each
joint is taken as autoregressive, and the covariance of the estimate follows from its spectrum.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import fft, linalg

from paramreduce_cli.records import FloatArray

_ORDERS = (0, 1, 2, 3, 4, 6, 8, 12, 16)
"""Orders of autoregressive models, among which Akaike's criterion chooses."""
_NOTHING = 1e-300
_HALVINGS = 6
_DEFINITE = 1e-9


@dataclass(frozen=True)
class ColouredNoise:
    """An autoregressive model of noise: e_k = sum_i coefficients_i e_{k-i} + white noise."""

    coefficients: FloatArray
    """(order,)"""
    variance: float
    """Variance of the white noise that drives it."""

    def compute_spectrum(self, n: int) -> FloatArray:
        """Return the power at the n // 2 + 1 frequencies of a real Fourier transform of length n."""
        response = fft.rfft(np.concatenate([[1.0], -self.coefficients]), n)
        power: FloatArray = self.variance / np.abs(response) ** 2
        return power


def estimate_autocovariance(segments: Sequence[FloatArray]) -> FloatArray:
    """Return the autocovariances of a joint's residuals over all segments, (n_lags,)."""
    n = sum(r.size for r in segments)
    most = max(0, min(_ORDERS[-1], max(r.size for r in segments) // 4))
    sums = [
        sum(float(r[lag:] @ r[: r.size - lag]) for r in segments if r.size > lag)
        for lag in range(most + 1)
    ]
    return np.array(sums) / n


def add_lost_noise(seen: FloatArray, lost: FloatArray) -> FloatArray:
    """Return autocovariances corrected for the noise that the fit absorbs, as far as they stay positive definite.

    Args:
        seen: Autocovariances of residuals, (n_lags,).
        lost: Autocovariances to add.
    """
    for _ in range(_HALVINGS):
        result: FloatArray = seen + lost[: seen.size]
        if np.linalg.eigvalsh(linalg.toeplitz(result))[0] > _DEFINITE * result[0] > 0:
            return result
        lost = lost / 2
    return seen


def fit_noise(autocovariance: FloatArray, n: int) -> ColouredNoise:
    """Return the autoregressive model of residuals, by the Yule-Walker equations [Stoica2005], Sec. 3.4.

    Args:
        autocovariance: Autocovariances, (n_lags,).
        n: Number of samples that the autocovariances were estimated from.
    """
    if not autocovariance[0] > 0:
        return ColouredNoise(np.zeros(0), _NOTHING)
    most = autocovariance.size - 1
    best: tuple[float, ColouredNoise] | None = None
    for order in (k for k in _ORDERS if k <= most):
        coefficients = np.zeros(0)
        if order:
            coefficients = linalg.solve_toeplitz(
                autocovariance[:order], autocovariance[1 : order + 1]
            )
        variance = float(autocovariance[0] - coefficients @ autocovariance[1 : order + 1])
        variance = max(variance, 1e-12 * float(autocovariance[0]), _NOTHING)
        criterion = n * np.log(variance) + 2 * order
        if best is None or criterion < best[0]:
            best = (criterion, ColouredNoise(coefficients, variance))
    assert best is not None
    return best[1]


def compute_score_covariance(
    segments: Iterable[FloatArray], noise: Sequence[ColouredNoise], weights: FloatArray
) -> FloatArray:
    """Return X' V X of the weighted rows, with V the covariance of the weighted noise, (p, p).

    Args:
        segments: Columns of uninterrupted motions, (n_samples, n_dof, p) each.
        noise: Noise of each joint.
        weights: Squares of the factors that rows of each joint are multiplied by, (n_dof,).
    """
    total: FloatArray | None = None
    for X in segments:
        n = fft.next_fast_len(2 * X.shape[0], real=True)
        for j, model in enumerate(noise):
            if weights[j] == 0:
                continue
            transformed = fft.rfft(X[:, j], n, axis=0)
            power = model.compute_spectrum(n) * weights[j] ** 2
            twice = np.full(power.size, 2.0)  # frequencies and their mirror images
            twice[0] = 1.0
            if n % 2 == 0:
                twice[-1] = 1.0
            scaled = transformed * np.sqrt(power * twice / n)[:, None]
            part = np.real(scaled.conj().T @ scaled)
            total = part if total is None else total + part
    assert total is not None
    return total


def compute_absorbed_noise(
    segments: Sequence[FloatArray],
    noise: Sequence[ColouredNoise],
    weights: FloatArray,
    inverse: FloatArray,
    covariance: FloatArray,
) -> FloatArray:
    """Return the expected autocovariances of the noise minus those of the residuals of a weighted fit, (n_dof, n_lags).

    Args:
        segments: Columns of uninterrupted motions, (n_samples, n_dof, p) each.
        noise: Noise of each joint.
        weights: Squares of the factors that rows of each joint are multiplied by, (n_dof,).
        inverse: Inverse of X' X of the weighted rows, (p, p).
        covariance: Covariance of the fitted parameters, (p, p).
    """
    n_samples = sum(len(X) for X in segments)
    result = np.zeros((len(noise), 1 + _ORDERS[-1]))
    for X in segments:
        size = X.shape[0]
        n = fft.next_fast_len(2 * size, real=True)
        for j in np.flatnonzero(weights).tolist():
            transformed = fft.rfft(X[:, j], n, axis=0)
            power = noise[j].compute_spectrum(n) * weights[j]
            # Covariance of each sample of the noise with the right side of the normal equations.
            joint = fft.irfft(transformed * power[:, None], n, axis=0)[:size]
            lost = 2 * fft.rfft(joint, n, axis=0) @ inverse - transformed @ covariance
            spectrum = np.sum(lost * transformed.conj(), axis=1).real
            lags = fft.irfft(spectrum, n)[: min(size, result.shape[1])]
            result[j, : lags.size] += lags / n_samples
    return result


def count_degrees_of_freedom(
    segments: Iterable[FloatArray],
    noise: Sequence[ColouredNoise],
    weights: FloatArray,
    inverse: FloatArray,
) -> FloatArray:
    """Return the degrees of freedom of each parameter's variance, (p,) [Satterthwaite1946].

    A variance is a sum over frequencies and joints of the noise's power at which the parameter is told from the others;
    the power at one frequency has two degrees of freedom.

    Args:
        segments: Columns of uninterrupted motions, (n_samples, n_dof, p) each.
        noise: Noise of each joint.
        weights: Squares of the factors that rows of each joint are multiplied by, (n_dof,).
        inverse: Inverse of X' X of the weighted rows, (p, p).
    """
    total, squares = np.zeros(len(inverse)), np.zeros(len(inverse))
    for X in segments:
        n = fft.next_fast_len(2 * X.shape[0], real=True)
        for j in np.flatnonzero(weights).tolist():
            power = noise[j].compute_spectrum(n) * weights[j] ** 2
            parts = np.abs(fft.rfft(X[:, j], n, axis=0) @ inverse) ** 2 * power[:, None] / n
            total += parts.sum(axis=0)
            squares += np.sum(parts**2, axis=0)
    # The transform has twice as many frequencies as the samples tell apart, which cancels the two.
    return np.maximum(1.0, total**2 / np.maximum(squares, _NOTHING))


def count_effective_samples(noise: ColouredNoise, n_samples: int) -> float:
    """Return the number of white samples that determine a constant as well as these coloured ones."""
    order = noise.coefficients
    variance = compute_variance(noise)
    at_rest = noise.variance / max(1e-12, (1 - float(np.sum(order))) ** 2)
    return n_samples * variance / at_rest


def compute_variance(noise: ColouredNoise) -> float:
    """Return the variance of the noise."""
    n = 8192
    power = noise.compute_spectrum(n)
    return float((2 * power.sum() - power[0] - power[-1]) / n)
