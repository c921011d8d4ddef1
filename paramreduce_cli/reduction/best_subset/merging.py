"""Proofs of several jobs, merged into one record."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from paramreduce_cli.errors import DataError
from paramreduce_cli.records import IntArray, Proofs, ProofStatus
from paramreduce_cli.reduction.best_subset.parts import concatenate_logs
from paramreduce_cli.reduction.best_subset.subset_search import BEGINNING
from paramreduce_cli.reduction.best_subset.ties import find_ties


def join_subtrees(parts: Sequence[Proofs]) -> Proofs:
    """Join searches of which each job has done a part of the subtrees.

    Args:
        parts: Proofs of all jobs on the same data.

    Raises:
        DataError: The jobs divided the search in different ways.
    """
    first = parts[0]
    for row, n in enumerate(first.n.tolist()):
        if (
            not all(_has_same_sizes(one, first) for one in parts)
            or len(_list_deals(parts, row)) > 1
        ):
            raise DataError(
                f"the {len(parts)} parts have not split the search for {n} parameters into the same subtrees, as "
                "machines do that calculate differently. Make all again on machines of one kind, or write "
                "reduction.best_subset.parts: sizes."
            )
    best = [_find_best(parts, row) for row in range(first.n.size)]
    error = np.array([one.torque_error[row] for row, one in enumerate(best)])
    return Proofs(
        units=first.units,
        n=first.n,
        subsets=tuple(one.subsets[row] for row, one in enumerate(best)),
        torque_error=error,
        lower_bound=np.minimum(error, np.min([one.lower_bound for one in parts], axis=0)),
        status=tuple(
            _combine_statuses([one.status[row] for one in parts]) for row in range(first.n.size)
        ),
        seconds=np.sum([one.seconds for one in parts], axis=0),
        nodes=np.sum([one.nodes for one in parts], axis=0),
        logs=tuple(_join_logs(parts, row) for row in range(first.n.size)),
        dealt=np.zeros_like(first.n),
    )


def _find_best(parts: Sequence[Proofs], row: int) -> Proofs:
    """Return the proofs of the job with the best subset; of tied subsets, the one whose columns come first."""
    squared = np.array([one.torque_error[row] for one in parts]) ** 2
    ties = np.flatnonzero(find_ties(squared, squared.min()))
    return min((parts[int(k)] for k in ties), key=lambda one: one.subsets[row].tolist())


def _is_started(proofs: Proofs, row: int) -> bool:
    return proofs.status[row] is not ProofStatus.BEST_FOUND or proofs.logs[row].size > 0


def _list_deals(parts: Sequence[Proofs], row: int) -> set[int]:
    """Return the digests of the subtrees that started jobs were given."""
    return {int(one.dealt[row]) for one in parts if _is_started(one, row)}


def _join_logs(parts: Sequence[Proofs], row: int) -> IntArray:
    """Return where all jobs have stopped, or the beginning if some have not started, as no log has their subtrees."""
    if not all(_is_started(one, row) for one in parts):
        return BEGINNING
    return concatenate_logs([one.logs[row] for one in parts])


def _combine_statuses(statuses: Sequence[ProofStatus]) -> ProofStatus:
    """Return what is proven if every job must have proven its part."""
    order = (
        ProofStatus.UNCERTIFIED,
        ProofStatus.BEST_FOUND,
        ProofStatus.OPTIMAL,
        ProofStatus.BEYOND_RANK,
    )
    return min(statuses, key=order.index)


def merge_proofs(proofs: Sequence[Proofs]) -> Proofs:
    """Merge what several searches on the same data know of each size.

    Args:
        proofs: Proofs of any sizes; those of other groups than the last are left out.

    Returns:
        For every size the entry that says most: what is proven, else the smaller error; with the
        largest bound of all.
    """
    groups = proofs[-1].units
    usable = [one for one in proofs if _is_same(one.units, groups)]
    sizes = sorted({n for one in usable for n in one.n.tolist()})
    return _stack_sizes(
        [_merge_size([one.get_size(n) for one in usable if n in one.n]) for n in sizes]
    )


def _merge_size(proofs: Sequence[Proofs]) -> Proofs:
    """Return the strongest proof of one size."""

    def rank_proof(proofs: Proofs) -> tuple[bool, float, float, int]:
        """Return the rank of a proof: finished before unfinished, then smaller errors, then higher bounds."""
        unfinished = proofs.status[0] is ProofStatus.BEST_FOUND
        error, bound = float(proofs.torque_error[0]), float(proofs.lower_bound[0])
        return unfinished, error, -bound, -int(proofs.nodes[0])  # of equal ones the furthest search

    return replace(
        min(proofs, key=rank_proof), lower_bound=np.max([one.lower_bound for one in proofs], axis=0)
    )


def _stack_sizes(proofs: Sequence[Proofs]) -> Proofs:
    """Return proofs of one size each as one record."""
    arrays = ("n", "torque_error", "lower_bound", "seconds", "nodes", "dealt")
    tuples = ("subsets", "status", "logs")
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(one, name) for one in proofs]) for name in arrays
    }
    columns |= {name: tuple(getattr(one, name)[0] for one in proofs) for name in tuples}
    return Proofs(units=proofs[0].units, **columns)


def _has_same_sizes(first: Proofs, other: Proofs) -> bool:
    return np.array_equal(first.n, other.n) and _is_same(first.units, other.units)


def _is_same(first: Sequence[IntArray], other: Sequence[IntArray]) -> bool:
    return len(first) == len(other) and all(map(np.array_equal, first, other))
