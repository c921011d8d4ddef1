"""Samples that tell an audience how far the reading of them has come."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from paramreduce_cli.records import Block, FloatArray, Progress, ProgressCallback, SampleSet


def add_progress(
    blocks: Iterable[Block], n_samples: int, what: str, report_progress: ProgressCallback
) -> Iterator[Block]:
    """Yield blocks unchanged, and report the progress of the reading."""
    done = 0
    for block in blocks:
        yield block
        done += block.time.size
        report_progress(Progress(what, done, n_samples))


@dataclass(frozen=True)
class ProgressSet:
    """A sample set whose samples are computed as they are read, with a progress callback."""

    computed: SampleSet
    what: str
    on_progress: ProgressCallback

    @property
    def n_samples(self) -> int:
        """Number of samples in all."""
        return self.computed.n_samples

    @property
    def recomputable(self) -> bool:
        """Whether each sample's state and the model give its rows of the observation matrix back."""
        return self.computed.recomputable

    def iterate_blocks(self) -> Iterator[Block]:
        """Yield the samples in order; every call starts anew."""
        return add_progress(
            self.computed.iterate_blocks(), self.n_samples, self.what, self.on_progress
        )

    def compute_factors(self) -> FloatArray:
        """Return the triangular factors of [W | tau] per trajectory and joint."""
        return self.computed.compute_factors()
