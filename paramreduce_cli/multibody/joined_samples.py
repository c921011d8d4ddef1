"""A sample set that consists of several stored ones."""

from collections.abc import Iterator, Sequence
from typing import Protocol

from paramreduce_cli.multibody.observation import join_factors
from paramreduce_cli.records import Block, FloatArray, SampleSet


class StoredStates(SampleSet, Protocol):
    """A stored set whose states can be read without W."""

    @property
    def first(self) -> int:
        """Number of its first trajectory."""

    def iterate_states(self) -> Iterator[Block]:
        """Yield the samples in order, with observation matrices of no rows."""


class JoinedSet:
    """A sample set that joins consecutive parts.

    Args:
        parts: Parts in their order.
    """

    recomputable = True
    first = 0

    def __init__(self, parts: Sequence[StoredStates]) -> None:
        self._parts = parts

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return sum(part.n_samples for part in self._parts)

    def iterate_blocks(self) -> Iterator[Block]:
        """Yield the samples in order; every call starts anew."""
        for part in self._parts:
            yield from part.iterate_blocks()

    def iterate_states(self) -> Iterator[Block]:
        """Yield the samples with observation matrices without rows."""
        for part in self._parts:
            yield from part.iterate_states()

    def compute_factors(self) -> FloatArray:
        """Return the triangular factors by trajectory and joint, from those of the parts."""
        return join_factors((part.first, part.compute_factors()) for part in self._parts)
