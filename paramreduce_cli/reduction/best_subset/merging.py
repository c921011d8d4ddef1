"""Proofs of several jobs as one."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from paramreduce_cli.errors import DataError
from paramreduce_cli.records import IntArray, Proofs, ProofStatus
from paramreduce_cli.reduction.best_subset.parts import together
from paramreduce_cli.reduction.best_subset.search import BEGINNING
from paramreduce_cli.reduction.best_subset.ties import as_good


def joined(shares: Sequence[Proofs]) -> Proofs:
    """Searches of which each job has done a share of the subtrees, as one.

    Args:
        shares: Of all jobs, on the same data.

    Raises:
        DataError: They were not dealt the same subtrees.
    """
    first = shares[0]
    for row, n in enumerate(first.n.tolist()):
        if not all(_alike(one, first) for one in shares) or len(_deals(shares, row)) > 1:
            raise DataError(
                f"the {len(shares)} parts have not split the search for {n} parameters into the same subtrees, as "
                "machines do that calculate differently. Make all again on machines of one kind, or write "
                "reduction.best_subset.parts: sizes."
            )
    best = [_first_of_the_best(shares, row) for row in range(first.n.size)]
    error = np.array([one.torque_error[row] for row, one in enumerate(best)])
    return Proofs(
        units=first.units,
        n=first.n,
        subsets=tuple(one.subsets[row] for row, one in enumerate(best)),
        torque_error=error,
        lower_bound=np.minimum(error, np.min([one.lower_bound for one in shares], axis=0)),
        status=tuple(_of_all([one.status[row] for one in shares]) for row in range(first.n.size)),
        seconds=np.sum([one.seconds for one in shares], axis=0),
        nodes=np.sum([one.nodes for one in shares], axis=0),
        logs=tuple(_where_all_stand(shares, row) for row in range(first.n.size)),
        dealt=np.zeros_like(first.n),
    )


def _first_of_the_best(shares: Sequence[Proofs], row: int) -> Proofs:
    """Whose subset is best; of those as good as each other, whose columns come first."""
    squared = np.array([one.torque_error[row] for one in shares]) ** 2
    ties = np.flatnonzero(as_good(squared, squared.min()))
    return min((shares[int(k)] for k in ties), key=lambda one: one.subsets[row].tolist())


def _has_begun(one: Proofs, row: int) -> bool:
    return one.status[row] is not ProofStatus.BEST_FOUND or one.logs[row].size > 0


def _deals(shares: Sequence[Proofs], row: int) -> set[int]:
    """What jobs that have begun were dealt the subtrees of."""
    return {int(one.dealt[row]) for one in shares if _has_begun(one, row)}


def _where_all_stand(shares: Sequence[Proofs], row: int) -> IntArray:
    """Where all jobs have stopped; the beginning where some have not begun, as no log has their subtrees."""
    if not all(_has_begun(one, row) for one in shares):
        return BEGINNING
    return together([one.logs[row] for one in shares])


def _of_all(found: Sequence[ProofStatus]) -> ProofStatus:
    """What is proven where every share must be."""
    order = (
        ProofStatus.UNCERTIFIED,
        ProofStatus.BEST_FOUND,
        ProofStatus.OPTIMAL,
        ProofStatus.BEYOND_RANK,
    )
    return min(found, key=order.index)


def merged(proofs: Sequence[Proofs]) -> Proofs:
    """Return what several searches on the same data know of each size.

    Args:
        proofs: Proofs of any sizes; those of other units than the last are left out.

    Returns:
        For every size the entry that says most: what is proven, else the smaller error; with the
        largest bound of all.
    """
    units = proofs[-1].units
    usable = [one for one in proofs if _same_units(one.units, units)]
    sizes = sorted({n for one in usable for n in one.n.tolist()})
    return _stacked(
        [_merged_size([one.get_size(n) for one in usable if n in one.n]) for n in sizes]
    )


def _merged_size(proofs: Sequence[Proofs]) -> Proofs:
    """Return the proof of one size that says most."""

    def worth(one: Proofs) -> tuple[bool, float, float, int]:
        unfinished = one.status[0] is ProofStatus.BEST_FOUND
        error, bound = float(one.torque_error[0]), float(one.lower_bound[0])
        return unfinished, error, -bound, -int(one.nodes[0])  # of equal ones the furthest search

    return replace(
        min(proofs, key=worth), lower_bound=np.max([one.lower_bound for one in proofs], axis=0)
    )


def _stacked(proofs: Sequence[Proofs]) -> Proofs:
    """Return proofs of one size each as one record."""
    arrays = ("n", "torque_error", "lower_bound", "seconds", "nodes", "dealt")
    tuples = ("subsets", "status", "logs")
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(one, name) for one in proofs]) for name in arrays
    }
    columns |= {name: tuple(getattr(one, name)[0] for one in proofs) for name in tuples}
    return Proofs(units=proofs[0].units, **columns)


def _alike(one: Proofs, other: Proofs) -> bool:
    return np.array_equal(one.n, other.n) and _same_units(one.units, other.units)


def _same_units(one: Sequence[IntArray], other: Sequence[IntArray]) -> bool:
    return len(one) == len(other) and all(map(np.array_equal, one, other))
