"""Base parameters: the independent columns of W, and the dependent ones expressed in them.

Found from random states, as in [Gautier1991], with ranks decided relative to the largest
singular value of W with its columns scaled to unit length.
"""

import numpy as np
import scipy.linalg

from paramreduce_cli.errors import Cause, NumericalError
from paramreduce_cli.multibody.orthogonal import select_independent
from paramreduce_cli.records import (
    INERTIAL,
    BaseParameters,
    BoolArray,
    FloatArray,
    IntArray,
    Kind,
    Mechanism,
)

_AFFECTING_TOLERANCE = 1e-11
"""Against the largest column: round-off leaves 1e-15 in columns that cancel exactly."""

_NUMERICALLY_ZERO = 1e-10
_LENGTHS = {Kind.M: 2, Kind.MX: 1, Kind.MY: 1, Kind.MZ: 1}
"""Powers of a length in the effect of a parameter on a moment."""


def find_affecting_columns(W: FloatArray) -> BoolArray:
    """Find the columns that are not zero to rounding, relative to the longest one, (n,)."""
    norms = np.linalg.norm(W, axis=0)
    largest = norms.max(initial=0.0)
    result: BoolArray = norms > _AFFECTING_TOLERANCE * largest
    return result


def find_affecting_parameters(mechanism: Mechanism, K: FloatArray) -> BoolArray:
    """Find the parameters whose effect on some joint is not zero to rounding.

    Effects are compared joint by joint, in units in which the mechanism has the size one. So neither the size of the
    robot, nor the unit of a column, nor a joint with much larger torques hides an effect.

    Args:
        mechanism: The robot.
        K: Regressors of random states whose speeds and accelerations are about one, (n_states, n_dof, n).

    Returns:
        Whether each parameter has an effect, (n,).
    """
    norms = np.linalg.norm(K, axis=0)
    kinds = [parameter.kind for parameter in mechanism.parameters]
    scale = np.ones_like(norms)
    inertial = np.array([kind in INERTIAL for kind in kinds], dtype=bool)
    if inertial.any():
        size = mechanism.size
        units = np.array([size ** _LENGTHS.get(kind, 0) for kind in kinds])[inertial]
        largest = np.max(norms[:, inertial] / units, axis=1, keepdims=True)
        scale[:, inertial] = largest * units
    for drive in mechanism.drives:
        weight = float(np.abs(drive.weights).max()) or 1.0
        for kind, column in mechanism.find_drive_columns(drive).items():
            forces = weight if kind.order is not None else 1.0
            scale[:, column] = np.sqrt(len(K)) * weight * forces
    return np.any(norms > _AFFECTING_TOLERANCE * scale, axis=0)


def choose_base(
    W: FloatArray, preference: IntArray, tolerance: float, affects: BoolArray | None = None
) -> BaseParameters:
    """Choose independent columns greedily, in order of preference, and express the others in them.

    Args:
        W: Observation matrix of random states, (n_rows, n).
        preference: All column indices, the most preferred first.
        tolerance: Singular values below this fraction of the largest one count as zero.
        affects: Whether each column has an effect, (n,); decided beside the longest column if left out.

    Returns:
        Columns in the order of preference in which they were taken, and beta.

    Raises:
        NumericalError: The greedy choice and the singular values disagree, so that no rank can
            be told.
    """
    affects = find_affecting_columns(W) if affects is None else affects
    affecting = np.flatnonzero(affects)
    norms = np.linalg.norm(W[:, affecting], axis=0)
    scaled = W[:, affecting] / norms
    singular = np.linalg.svd(scaled, compute_uv=False)
    rank = int(np.sum(singular > tolerance * singular[0])) if singular.size else 0
    gap = float(singular[rank - 1] / singular[rank]) if 0 < rank < singular.size else np.inf

    compressed: FloatArray = np.linalg.qr(W, mode="r")  # type: ignore[assignment]
    candidates = preference[np.isin(preference, affecting)]
    chosen = select_independent(compressed, candidates, tolerance)
    if len(chosen) != rank:
        raise NumericalError(
            f"at {tolerance:g} the rank is not clear: {rank} by singular values, {len(chosen)} by "
            f"columns; the gap at {rank} is {gap:.3g}.",
            Cause.RANK,
        )
    columns = np.array(chosen, dtype=np.int64)
    return BaseParameters(columns, compute_regrouping(W, columns, affects), singular, gap)


def compute_regrouping(W: FloatArray, columns: IntArray, affects: BoolArray) -> FloatArray:
    """Express all other columns in the independent ones, W_others = W_columns beta.

    Args:
        W: Observation matrix, (n_rows, n).
        columns: Independent columns, (r,).
        affects: Whether each column has an effect, (n,).

    Returns:
        beta, (r, n - r); the others in ascending order, columns without effect as zeros.
    """
    others = np.setdiff1d(np.arange(W.shape[1]), columns)
    beta = np.zeros((columns.size, others.size))
    live = affects[others]
    if not live.any() or columns.size == 0:
        return beta
    own = np.linalg.norm(W[:, columns], axis=0)
    target = W[:, others[live]]
    lengths = np.linalg.norm(target, axis=0)
    solution, *_ = scipy.linalg.lstsq(W[:, columns] / own, target / lengths)
    solution[np.abs(solution) < _NUMERICALLY_ZERO] = 0.0
    beta[:, live] = solution * lengths / own[:, None]
    return beta
