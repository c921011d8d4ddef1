"""Operation counts of models that keep some parameters; shared by the stages."""

from __future__ import annotations

import numpy as np

from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.records import BoolArray, FloatArray


def count_operations(
    dynamics: Dynamics,
    affecting: BoolArray,
    expansion: FloatArray,
    *,
    independent: bool,
    signs_free: bool = True,
    direct: bool = True,
) -> tuple[int, int]:
    """Operations of the inverse and of the direct dynamics, zero for what is not asked for.

    Args:
        dynamics: Of the mechanism.
        affecting: Parameters that change the torques at all, (n_standard,).
        expansion: Standard parameters from the values kept, (n_standard, n).
        independent: See :meth:`Dynamics.count_operations`.
        signs_free: Whether sign changes cost nothing.
        direct: Whether the direct dynamics is counted too.
    """
    kept = np.flatnonzero(expansion.any(axis=1) & affecting)
    first = np.argmax(expansion != 0, axis=0)
    owner = first[np.argmax(expansion[kept] != 0, axis=1)]
    same = {int(k): int(other) for k, other in zip(kept, owner, strict=True) if k != other}
    return dynamics.count_operations(
        kept, same=same, signs_free=signs_free, independent=independent, direct=direct
    )
