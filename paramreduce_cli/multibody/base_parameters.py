"""Base parameters: which columns of W are independent, and what the others are made of.

Found from random states, as in [Gautier1991], with ranks decided relative to the largest
singular value of W with its columns scaled to unit length.
"""

import numpy as np
import scipy.linalg

from paramreduce_cli.errors import Concern, ConcernError
from paramreduce_cli.multibody.orthogonal import independent_columns
from paramreduce_cli.records import BaseParameters, BoolArray, FloatArray, IntArray

_AFFECTING_TOLERANCE = 1e-11
"""Against the largest column: round-off leaves 1e-15 in columns that cancel exactly."""

_NUMERICALLY_ZERO = 1e-10


def affecting_columns(W: FloatArray) -> BoolArray:
    """Columns that are not zero to rounding, (n,)."""
    norms = np.linalg.norm(W, axis=0)
    largest = norms.max(initial=0.0)
    result: BoolArray = norms > _AFFECTING_TOLERANCE * largest
    return result


def base_parameters(W: FloatArray, preference: IntArray, tolerance: float) -> BaseParameters:
    """Choose independent columns greedily and express the others in them.

    Args:
        W: Observation matrix of random states, (n_rows, n).
        preference: All column indices, the most wanted first.
        tolerance: Singular values below this share of the largest one count as zero.

    Returns:
        Columns in the order of preference in which they were taken, and beta.

    Raises:
        ConcernError: The greedy choice and the singular values disagree, so that no rank can
            be told.
    """
    affecting = np.flatnonzero(affecting_columns(W))
    norms = np.linalg.norm(W[:, affecting], axis=0)
    scaled = W[:, affecting] / norms
    singular = np.linalg.svd(scaled, compute_uv=False)
    rank = int(np.sum(singular > tolerance * singular[0])) if singular.size else 0
    gap = float(singular[rank - 1] / singular[rank]) if 0 < rank < singular.size else np.inf

    compressed: FloatArray = np.linalg.qr(W, mode="r")  # type: ignore[assignment]
    wanted = preference[np.isin(preference, affecting)]
    taken = independent_columns(compressed, wanted, tolerance)
    if len(taken) != rank:
        raise ConcernError(
            f"at {tolerance:g} the rank is not clear: {rank} by singular values, {len(taken)} by "
            f"columns; the gap at {rank} is {gap:.3g}.",
            Concern.RANK,
        )
    columns = np.array(taken, dtype=np.int64)
    return BaseParameters(columns, regrouping(W, columns), singular, gap)


def regrouping(W: FloatArray, columns: IntArray) -> FloatArray:
    """Express all other columns in the independent ones, W_others = W_columns beta.

    Args:
        W: Observation matrix, (n_rows, n).
        columns: Independent columns, (r,).

    Returns:
        beta, (r, n - r); the others in ascending order, columns without effect as zeros.
    """
    others = np.setdiff1d(np.arange(W.shape[1]), columns)
    beta = np.zeros((columns.size, others.size))
    live = affecting_columns(W)[others]
    if not live.any() or columns.size == 0:
        return beta
    own = np.linalg.norm(W[:, columns], axis=0)
    target = W[:, others[live]]
    lengths = np.linalg.norm(target, axis=0)
    solution, *_ = scipy.linalg.lstsq(W[:, columns] / own, target / lengths)
    solution[np.abs(solution) < _NUMERICALLY_ZERO] = 0.0
    beta[:, live] = solution * lengths / own[:, None]
    return beta
