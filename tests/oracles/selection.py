"""Errors by definition, exhaustive search over subsets, and heuristics word by word."""

from itertools import combinations

import numpy as np


def error_by_definition(W, chi, kept):
    kept = list(kept)
    if not kept:
        return 1.0
    phi, *_ = np.linalg.lstsq(W[:, kept], chi, rcond=None)
    return np.linalg.norm(chi - W[:, kept] @ phi) / np.linalg.norm(chi)


def all_best_errors(W, chi, sets=None):
    """Smallest error of any union of the sets, else of columns, by its number of columns.

    Of at most that many columns. Every subset is orthogonalised anew, column by column and twice,
    all of one size together.
    """
    sets = [[c] for c in range(W.shape[1])] if sets is None else sets
    X = W / np.linalg.norm(W, axis=0)
    y = chi / np.linalg.norm(chi)
    total = sum(map(len, sets))
    best = np.full(total + 1, np.inf)
    best[0] = 1.0
    by_size = {}
    for count in range(1, len(sets) + 1):
        for chosen in combinations(sets, count):
            columns = [c for one in chosen for c in one]
            by_size.setdefault(len(columns), []).append(columns)
    for n, listed in by_size.items():
        A = X.T[np.array(listed)]
        left = np.broadcast_to(y, (len(listed), y.size)).copy()
        for k in range(n):
            v = A[:, k]
            for _ in range(2):
                v = v - ((A[:, :k] @ v[..., None]).swapaxes(1, 2) @ A[:, :k])[:, 0]
            length = np.linalg.norm(v, axis=1, keepdims=True)
            v = np.where(length > 1e-9, v / np.where(length > 0, length, 1.0), 0.0)
            A[:, k] = v
            left = left - np.sum(v * left, axis=1, keepdims=True) * v
        best[n] = np.linalg.norm(left, axis=1).min()
    return np.minimum.accumulate(best)


def forward_two_passes(W, chi, largest):
    """Algorithm 3 with the second addition that its text describes."""
    kept, found, before = [], {}, None

    def add():
        rest = [k for k in range(W.shape[1]) if k not in kept]
        kept.append(min(rest, key=lambda k: error_by_definition(W, chi, [*kept, k])))

    while len(kept) < largest:
        add()
        if before is not None:
            kept.remove(before)
            add()
        before = kept[-1]
        found[len(kept)] = list(kept)
    return found


def floating_forward(W, chi, largest):
    """Add the best; take out the least while that beats the best subset of the smaller size."""
    kept, best = [], {}

    def error(columns):
        return error_by_definition(W, chi, columns)

    while len(kept) < largest:
        rest = [k for k in range(W.shape[1]) if k not in kept]
        kept = [*kept, min(rest, key=lambda k: error([*kept, k]))]
        if len(kept) not in best or error(kept) < error(best[len(kept)]) * (1 - 1e-9):
            best[len(kept)] = kept
        while len(kept) > 2:
            least = min(kept, key=lambda k: error([c for c in kept if c != k]))
            shorter = [c for c in kept if c != least]
            if not error(shorter) < error(best[len(shorter)]) * (1 - 1e-9):
                break
            kept = best[len(shorter)] = shorter
        kept = best[len(kept)]
    return best
