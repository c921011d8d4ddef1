"""Proofs of the best subsets that are kept as items of ``reduce``, by size or by a job's subtrees."""

from collections.abc import Sequence

import numpy as np

from paramreduce_cli.errors import DataError
from paramreduce_cli.records import FloatArray, Items, ProofItem, Proofs, ProofStatus
from paramreduce_cli.reduction.best_subset.merging import joined

_UNFINISHED = "-unfinished"
"""Ending of the keys of searches that Ctrl-C ended."""


class KeptProofs:
    """Proofs among the items of the stage that hold on the data at hand.

    Args:
        items: Items of the stage.
        factor: Triangular factor of the weighted [W | chi] of the estimation set, (n + 1, n + 1).
        by_subtrees: Whether every job takes a part of the search for every size, not some sizes.
    """

    def __init__(self, items: Items, factor: FloatArray, *, by_subtrees: bool) -> None:
        self._items, self._factor = items, factor
        self._by_subtrees = by_subtrees and not items.part.is_whole

    def is_finished(self, sizes: Sequence[int]) -> bool:
        """Whether this job has nothing left to do for some sizes."""
        keys = [self._key] if self._by_subtrees else map(_size_key, self._own(sizes))
        return all(key in self._items.kept for key in keys)

    def load(self) -> list[Proofs]:
        """Return the proofs that can be gone on with.

        Raises:
            DataError: Some jobs have searched their subtrees and others have not, or on other numbers.
        """
        if self._by_subtrees:
            kept = self._items.kept.get(self._key) or self._items.kept.get(self._key + _UNFINISHED)
            return self._usable([kept] if kept else [])
        found = [self._items.kept.get(key) for key in self._items.kept if key.startswith("n-")]
        jobs = [] if not self._items.part.is_whole else self._subtrees()
        return self._usable([item for item in found if item]) + ([joined(jobs)] if jobs else [])

    def keep(self, proofs: Proofs, *, cut_short: bool = False) -> None:
        """Keep what this job has proven.

        Args:
            proofs: Proofs of any sizes.
            cut_short: Whether Ctrl-C ended the searches that have not proven anything yet.
        """
        if self._by_subtrees:
            key = self._key + (_UNFINISHED if cut_short else "")
            self._items.kept[key] = ProofItem(self._factor, proofs)
            return
        for n in self._own(proofs.n.tolist()):
            own = proofs.of_size(n)
            ended = own.status[0] is not ProofStatus.BEST_FOUND or not cut_short
            key = _size_key(n) + ("" if ended else _UNFINISHED)
            self._items.kept[key] = ProofItem(self._factor, own)

    def keep_size(self, proofs: Proofs) -> None:
        """Keep the proof of one size whose search has ended, unless it is of one job's subtrees alone."""
        if not self._by_subtrees:
            self._items.kept[_size_key(int(proofs.n[0]))] = ProofItem(self._factor, proofs)

    @property
    def _key(self) -> str:
        return _subtrees_key(self._items.part.number, self._items.part.count)

    def _own(self, sizes: Sequence[int]) -> list[int]:
        return self._items.part.select(sizes)

    def _subtrees(self) -> list[Proofs]:
        """Return what the jobs have found that have split the searches, the latest number of jobs first.

        Raises:
            DataError: A job is missing, or its samples have other last digits.
        """
        counts = {int(key.split("-")[3]) for key in self._items.kept if key.startswith("subtrees-")}
        for count in sorted(counts, reverse=True):
            found = {}
            for number in range(1, count + 1):
                key = _subtrees_key(number, count)
                item = self._items.kept.get(key) or self._items.kept.get(key + _UNFINISHED)
                if item is not None:
                    found[number] = item
            if not found:
                continue
            missing = [f"{k}/{count}" for k in range(1, count + 1) if k not in found]
            if missing:
                raise DataError(
                    f"{len(missing)} of the {count} parts of the searches are missing. Do each with --part "
                    f"({', '.join(missing[:5])}{', ...' if len(missing) > 5 else ''}), or do without parts with --force."
                )
            usable = self._usable(list(found.values()))
            if len(usable) < count and any(item.proofs.dealt.any() for item in found.values()):
                raise DataError(
                    f"{count - len(usable)} of the {count} parts are of samples that were added up to other last "
                    "digits, as machines do that calculate differently. Make them again on machines of the kind of this "
                    "one, or do without them with --force."
                )
            return usable
        return []

    def _usable(self, found: Sequence[ProofItem]) -> list[Proofs]:
        return [item.proofs for item in found if np.array_equal(item.factor, self._factor)]


def _size_key(n: int) -> str:
    return f"n-{n:04d}"


def _subtrees_key(number: int, count: int) -> str:
    return f"subtrees-{number:04d}-of-{count:04d}"
