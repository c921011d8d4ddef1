"""The scaling that looks at all columns of W, not at the base columns alone."""

import numpy as np

from paramreduce_cli.excitation.scalings import Pullback
from paramreduce_cli.records import FloatArray


def full(W: FloatArray, beta: FloatArray, norm: float) -> tuple[FloatArray, Pullback]:
    """Return all columns of W, dependent ones too, for the condition number by the non-zero singular values [Ros2019].

    W_all = W [1 beta] up to order, so its singular values are those of W L with L L' = 1 + beta beta'.
    """
    L = np.linalg.cholesky(np.eye(beta.shape[0]) + beta @ beta.T)
    return W @ L, lambda _, C: W @ (L @ C @ L.T)
