"""Base parameters: which columns of W are independent, and what the others are made of.

Found from random states, as in [Gautier1991], with ranks decided relative to the largest
singular value of W with its columns scaled to unit length.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

from paramreduce_cli.errors import RankError
from paramreduce_cli.records import BaseParameters, BoolArray, FloatArray, IntArray

PREFERENCE = ("Izz", "Ixx", "Ixy", "Ixz", "Iyz", "mx", "my", "Iyy", "mz", "m")
"""Kinds of parameters in the order in which they are preferred as base parameters.

For revolute arms it yields Khalil's set [Khalil1987]: Izz of the first body and seven
parameters of every other one, with Iyy, mz and m regrouped.
"""

_AFFECTING_TOLERANCE = 1e-11
"""Against the largest column: round-off leaves 1e-15 in columns that cancel exactly."""

_NUMERICALLY_ZERO = 1e-10

DEPENDENT = 1e-9
"""A column is dependent on others when no more than this share of its length is left of it."""


def preference_order(names: tuple[str, ...]) -> IntArray:
    """Parameter indices from the most to the least preferred.

    By kind as in :data:`PREFERENCE`; within a kind by position. Names of another form come
    after all others. This order breaks every tie in the project.
    """
    rank = {kind: k for k, kind in enumerate(PREFERENCE)}
    kinds = np.array([rank.get(name.split("_", 1)[0], len(PREFERENCE)) for name in names])
    return np.lexsort((np.arange(len(names)), kinds)).astype(np.int64)


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
        RankError: The greedy choice and the singular values disagree, so that no rank can
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
        raise RankError(
            f"the rank is not clear: {rank} by singular values, {len(taken)} by columns; the gap "
            f"at {rank} is {gap:.3g}. Raise or lower model.rank_tolerance (now {tolerance:g})."
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


def independent_columns(W: FloatArray, wanted: IntArray, tolerance: float = DEPENDENT) -> list[int]:
    """Take columns in the order wanted, leaving out those that depend on columns taken before.

    Args:
        W: (k, n)
        wanted: Column indices.
        tolerance: A column depends on others when no more than this share of its length is
            left of it.
    """
    basis = np.empty((W.shape[0], 0))
    taken: list[int] = []
    for column in wanted:
        vector = W[:, column]
        length = np.linalg.norm(vector)
        for _ in range(2):
            vector = vector - basis @ (basis.T @ vector)
        rest = np.linalg.norm(vector)
        if rest > tolerance * length and length > 0:
            taken.append(int(column))
            basis = np.column_stack([basis, vector / rest])
    return taken
