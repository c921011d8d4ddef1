"""How sure estimated parameters are when the noise of the torques is coloured.

Residuals of a fast log follow one another closely, so that many samples say little more than a
few; standard deviations for white noise are then several times too small. The noise of each
joint is taken as autoregressive, and the covariance of the estimate follows from its spectrum.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # its signal takes half a second to load, so only when it is used
from scipy import fft, linalg

from paramreduce_cli.records import FloatArray

_ORDERS = (0, 1, 2, 3, 4, 6, 8, 12, 16)
"""Of autoregressive models, among which Akaike's criterion chooses."""
_NOTHING = 1e-300
_HALVINGS = 6
_DEFINITE = 1e-9
_SETTLING = 1000
"""Samples after which drawn noise has forgotten how it began."""


@dataclass(frozen=True)
class ColouredNoise:
    """Autoregressive noise: e_k = sum_i coefficients_i e_{k-i} + white noise."""

    coefficients: FloatArray
    """(order,)"""
    variance: float
    """Of the white noise that drives it."""

    def spectrum(self, n: int) -> FloatArray:
        """Power at the n // 2 + 1 frequencies of a real Fourier transform of length n."""
        response = fft.rfft(np.concatenate([[1.0], -self.coefficients]), n)
        power: FloatArray = self.variance / np.abs(response) ** 2
        return power

    def drawn(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Some of it, (n,)."""
        white = np.sqrt(self.variance) * rng.standard_normal(n + _SETTLING)
        denominator = np.concatenate([[1.0], -self.coefficients])
        result: FloatArray = scipy.signal.lfilter([1.0], denominator, white)[_SETTLING:]
        return result


def autocovariance_of(segments: Sequence[FloatArray]) -> FloatArray:
    """Autocovariances of a joint's residuals over all segments, (n_lags,)."""
    n = sum(r.size for r in segments)
    most = max(0, min(_ORDERS[-1], max(r.size for r in segments) // 4))
    sums = [
        sum(float(r[lag:] @ r[: r.size - lag]) for r in segments if r.size > lag)
        for lag in range(most + 1)
    ]
    return np.array(sums) / n


def corrected(seen: FloatArray, lost: FloatArray) -> FloatArray:
    """Autocovariances with what a fit took out of them given back, as far as they stay some.

    Args:
        seen: Of residuals, (n_lags,).
        lost: What is to be added.
    """
    for _ in range(_HALVINGS):
        result: FloatArray = seen + lost
        if np.linalg.eigvalsh(linalg.toeplitz(result))[0] > _DEFINITE * result[0] > 0:
            return result
        lost = lost / 2
    return seen


def coloured_noise(autocovariance: FloatArray, n: int) -> ColouredNoise:
    """The autoregressive model of residuals, by the Yule-Walker equations [Stoica2005], Sec. 3.4.

    Args:
        autocovariance: (n_lags,)
        n: Samples that it is of.
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


def score_covariance(
    segments: Iterable[FloatArray], noise: Sequence[ColouredNoise], weights: FloatArray
) -> FloatArray:
    """X' V X of the weighted rows, with V the covariance of the weighted noise, (p, p).

    Args:
        segments: Columns of uninterrupted motions, (n_samples, n_dof, p) each.
        noise: Of each joint.
        weights: That rows of a joint are multiplied with twice, as in weighted least squares: one over
            the variance, (n_dof,).
    """
    total: FloatArray | None = None
    for X in segments:
        n = fft.next_fast_len(2 * X.shape[0], real=True)
        for j, model in enumerate(noise):
            if weights[j] == 0:
                continue
            transformed = fft.rfft(X[:, j], n, axis=0)
            power = model.spectrum(n) * weights[j] ** 2
            twice = np.full(power.size, 2.0)  # frequencies and their mirror images
            twice[0] = 1.0
            if n % 2 == 0:
                twice[-1] = 1.0
            scaled = transformed * np.sqrt(power * twice / n)[:, None]
            part = np.real(scaled.conj().T @ scaled)
            total = part if total is None else total + part
    assert total is not None
    return total


def effective_samples(noise: ColouredNoise, n_samples: int) -> float:
    """White samples that tell as much of a constant as these coloured ones."""
    order = noise.coefficients
    variance = noise_variance(noise)
    at_rest = noise.variance / max(1e-12, (1 - float(np.sum(order))) ** 2)
    return n_samples * variance / at_rest


def noise_variance(noise: ColouredNoise) -> float:
    """Variance of the noise itself."""
    n = 8192
    power = noise.spectrum(n)
    return float((2 * power.sum() - power[0] - power[-1]) / n)
