"""The condition number of W."""

import numpy as np

from paramreduce_cli.excitation.criteria import SMALLEST
from paramreduce_cli.records import FloatArray


def condition_number(eigenvalues: FloatArray, sharpness: float) -> tuple[float, FloatArray]:
    """Return the logarithm of a smooth condition number, log (sum l^p)^(1/2p) (sum l^-p)^(1/2p), which goes to log
    kappa as p grows.

    Args:
        eigenvalues: Eigenvalues of W'W, (r,).
        sharpness: The exponent p; infinite for the condition number itself.

    Returns:
        Value, and its derivative with respect to the eigenvalues, (r,).
    """
    safe = np.maximum(eigenvalues, SMALLEST)
    logs = np.log(safe)
    if np.isinf(sharpness):
        weight = np.zeros_like(logs)
        weight[np.argmax(logs)] += 1.0
        weight[np.argmin(logs)] -= 1.0
        return 0.5 * float(logs.max() - logs.min()), 0.5 * weight / safe
    up, up_share = _compute_log_sum_exp(sharpness * logs)
    down, down_share = _compute_log_sum_exp(-sharpness * logs)
    return 0.5 * (up + down) / sharpness, 0.5 * (up_share - down_share) / safe


def _compute_log_sum_exp(values: FloatArray) -> tuple[float, FloatArray]:
    """Return log sum exp and the fraction of each term."""
    largest = float(values.max())
    terms = np.exp(values - largest)
    total = float(terms.sum())
    return largest + float(np.log(total)), terms / total
