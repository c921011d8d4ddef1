"""What makes a trajectory exciting, as a function of the eigenvalues of W'W.

A criterion returns a smooth value to minimise with its derivative by the eigenvalues; the
sharper, the closer to the exact criterion.
"""

from __future__ import annotations

import numpy as np

from paramreduce_cli.records import FloatArray
from paramreduce_cli.registry import criterion

_SMALLEST = 1e-300


@criterion("condition-number")
def condition_number(eigenvalues: FloatArray, sharpness: float) -> tuple[float, FloatArray]:
    """Log of (sum l^p)^(1/2p) (sum l^-p)^(1/2p), which goes to log kappa as p grows.

    Args:
        eigenvalues: Of W'W, (r,).
        sharpness: The exponent p; infinite for the condition number itself.

    Returns:
        Value and derivative by the eigenvalues, (r,).
    """
    safe = np.maximum(eigenvalues, _SMALLEST)
    logs = np.log(safe)
    if np.isinf(sharpness):
        weight = np.zeros_like(logs)
        weight[np.argmax(logs)] += 1.0
        weight[np.argmin(logs)] -= 1.0
        return 0.5 * float(logs.max() - logs.min()), 0.5 * weight / safe
    up, up_share = _log_sum_exp(sharpness * logs)
    down, down_share = _log_sum_exp(-sharpness * logs)
    return 0.5 * (up + down) / sharpness, 0.5 * (up_share - down_share) / safe


def _log_sum_exp(values: FloatArray) -> tuple[float, FloatArray]:
    """Log sum exp and each term's share; scipy's takes longer than all the rest here."""
    largest = float(values.max())
    terms = np.exp(values - largest)
    total = float(terms.sum())
    return largest + float(np.log(total)), terms / total


@criterion("d-optimality")
def d_optimality(eigenvalues: FloatArray, sharpness: float) -> tuple[float, FloatArray]:
    """Minus half the logarithm of det W'W per parameter; smooth as it is."""
    safe = np.maximum(eigenvalues, _SMALLEST)
    r = eigenvalues.size
    return -0.5 * float(np.sum(np.log(safe))) / r, -0.5 / (safe * r)


def condition_from_matrix(W: FloatArray) -> float:
    """Condition number by singular values, infinite where the columns are dependent."""
    singular = np.linalg.svd(W, compute_uv=False)
    return float(singular[0] / singular[-1]) if singular[-1] > 0 else np.inf
