"""Proofs of best subsets that are kept as items of ``reduce``, by size or by a job's subtrees."""

import warnings
from collections.abc import Sequence

import numpy as np

from paramreduce_cli.errors import DataError, ParamreduceWarning
from paramreduce_cli.records import FloatArray, Items, ProofItem, Proofs, ProofStatus
from paramreduce_cli.reduction.best_subset.merging import join_subtrees, merge_proofs

_SIZE, _SUBTREES = "n-", "subtrees-"
"""Beginnings of the keys of one size's proof, and of one job's subtrees of all sizes."""
_UNFINISHED = "-unfinished"
"""Ending of the keys of searches that Ctrl-C ended."""


class KeptProofs:
    """The proofs among the items of the stage that hold on the data at hand.

    Args:
        items: Items of the stage.
        factor: Triangular factor of the weighted [W | chi] of the estimation set, (n + 1, n + 1).
        by_subtrees: Whether every job takes a part of the search for every size, not some sizes.
    """

    def __init__(self, items: Items, factor: FloatArray, *, by_subtrees: bool) -> None:
        self._items, self._factor = items, factor
        self._by_subtrees = by_subtrees and not items.part.is_whole

    def is_finished(self, sizes: Sequence[int]) -> bool:
        """Whether this job has nothing left to do for some sizes.

        Args:
            sizes: Numbers of parameters that are searched, 1, 2, ... up to the largest.
        """
        keys = (
            [self._key]
            if self._by_subtrees
            else [_make_size_key(n) for n in self._select_sizes(sizes)]
        )
        return all(key in self._items.kept and self._holds(self._items.kept[key]) for key in keys)

    def load(self, earlier: Proofs | None) -> Proofs | None:
        """Return the proofs that a search can continue from.

        Args:
            earlier: Proofs of an earlier artifact on the same data; None if there are none.

        Returns:
            The proof that says most, for every size; None if there is no proof.

        Raises:
            DataError: Some jobs have not searched their subtrees, or have searched them on other numbers.
        """
        found: list[Proofs] = []
        if self._by_subtrees:
            kept = self._items.kept.get(self._key) or self._items.kept.get(self._key + _UNFINISHED)
            found = self._list_usable([kept])
        else:
            sizes = [key for key in self._items.kept if key.startswith(_SIZE)]
            found = self._list_usable([self._items.kept.get(key) for key in sizes])
            found += self._join_subtrees() if self._items.part.is_whole else []
        if earlier is not None and not (self._by_subtrees and found):
            found.insert(0, earlier)
        return merge_proofs(found) if found else None

    def keep(self, proofs: Proofs, sizes: Sequence[int], *, cut_short: bool = False) -> None:
        """Keep what this job has proven.

        Args:
            proofs: Proofs of the sizes that have a subset.
            sizes: Numbers of parameters that are searched; with groups some have no subset.
            cut_short: Whether Ctrl-C ended the searches that have not proven anything yet.
        """
        if self._by_subtrees:
            key = self._key + (_UNFINISHED if cut_short else "")
            self._items.kept[key] = ProofItem(self._factor, proofs)
            return
        for n in self._select_sizes(sizes):
            if n not in proofs.n:
                self._items.kept[_make_size_key(n)] = None
                continue
            own = proofs.get_size(n)
            ended = own.status[0] is not ProofStatus.BEST_FOUND or not cut_short
            key = _make_size_key(n) + ("" if ended else _UNFINISHED)
            self._items.kept[key] = ProofItem(self._factor, own)

    def keep_size(self, proofs: Proofs) -> None:
        """Keep the proof of one size whose search has ended, unless it is of one job's subtrees alone."""
        if not self._by_subtrees:
            self._items.kept[_make_size_key(int(proofs.n[0]))] = ProofItem(self._factor, proofs)

    @property
    def _key(self) -> str:
        return _make_subtrees_key(self._items.part.number, self._items.part.count)

    def _select_sizes(self, sizes: Sequence[int]) -> list[int]:
        return self._items.part.select(sizes)

    def _join_subtrees(self) -> list[Proofs]:
        """Return the proofs of jobs that have split the searches, joined for every number of jobs that is complete.

        Raises:
            DataError: No number of jobs is complete, and the largest one lacks a job or has other last digits.
        """
        keys = [key for key in self._items.kept if key.startswith(_SUBTREES)]
        counts = sorted({int(key.split("-")[3]) for key in keys})
        joint: list[Proofs] = []
        incomplete: DataError | None = None
        for count in counts:
            try:
                joint += self._join_jobs(count)
            except DataError as error:
                incomplete = error
        if incomplete is not None and not joint:
            raise incomplete
        if incomplete is not None:
            warnings.warn(
                f"{str(incomplete).rstrip('.')}; the proofs of fewer parts, which are complete, are used",
                ParamreduceWarning,
                stacklevel=2,
            )
        return joint

    def _join_jobs(self, count: int) -> list[Proofs]:
        """Return the proofs of a number of jobs as one record in a list, which is empty if no job has ended.

        Raises:
            DataError: Some jobs have ended and others are missing, or they searched on different samples.
        """
        found: dict[int, ProofItem] = {}
        for number in range(1, count + 1):
            key = _make_subtrees_key(number, count)
            item = self._items.kept.get(key) or self._items.kept.get(key + _UNFINISHED)
            if item is not None:
                found[number] = item
        missing = [f"{k}/{count}" for k in range(1, count + 1) if k not in found]
        if found and missing:
            raise DataError(
                f"{len(missing)} of the {count} parts of the searches are missing. Do each with --part "
                f"({', '.join(missing[:5])}{', ...' if len(missing) > 5 else ''}), or do without parts with --force."
            )
        usable = self._list_usable(list(found.values()))
        if len(usable) < len(found) and any(item.proofs.dealt.any() for item in found.values()):
            raise DataError(
                f"{count - len(usable)} of the {count} parts are of samples that were added up to other last "
                "digits, as machines do that calculate differently. Make them again on machines of the kind of this "
                "one, or do without them with --force."
            )
        return [join_subtrees(usable)] if usable else []

    def _holds(self, item: ProofItem | None) -> bool:
        """Whether an item holds on the data at hand; None says that a size has no subset."""
        return item is None or np.array_equal(item.factor, self._factor)

    def _list_usable(self, items: Sequence[ProofItem | None]) -> list[Proofs]:
        return [item.proofs for item in items if item is not None and self._holds(item)]


def _make_size_key(n: int) -> str:
    return f"{_SIZE}{n:04d}"


def _make_subtrees_key(number: int, count: int) -> str:
    return f"{_SUBTREES}{number:04d}-of-{count:04d}"
