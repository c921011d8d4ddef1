"""Errors by definition and exhaustive search over subsets."""

from itertools import combinations

import numpy as np


def error_by_definition(W, chi, kept):
    phi, *_ = np.linalg.lstsq(W[:, kept], chi, rcond=None)
    return np.linalg.norm(chi - W[:, kept] @ phi) / np.linalg.norm(chi)


def best_subset_error(W, chi, n):
    return min(
        error_by_definition(W, chi, list(kept)) for kept in combinations(range(W.shape[1]), n)
    )
