"""Best subsets that jobs which search for the same tell each other, through files in a folder of theirs."""

import contextlib
from collections.abc import Iterator, MutableMapping
from pathlib import Path

from paramreduce_cli.artifacts.hdf5 import Stamp, read_stamp, reading, write
from paramreduce_cli.artifacts.parts import origin
from paramreduce_cli.errors import ArtifactError
from paramreduce_cli.records import IntArray


class StoredIncumbents(MutableMapping[int, IntArray]):
    """Subsets by size, a file each; what is damaged or of another config is as if it were not there.

    Nobody waits for anybody: the last to write wins, and whoever reads calculates the error anew.

    Args:
        folder: Of the jobs.
        stamp: Provenance of the artifact that they make.
    """

    def __init__(self, folder: Path, stamp: Stamp) -> None:
        self._folder, self._stamp = folder, stamp
        self._read: dict[int, tuple[int, IntArray | None]] = {}

    def _path(self, size: int) -> Path:
        return self._folder / f".incumbent-{size:04d}.h5"

    def __getitem__(self, size: int) -> IntArray:
        path = self._path(size)
        try:
            written = path.stat().st_mtime_ns
        except OSError as error:
            raise KeyError(size) from error
        if self._read.get(size, (0, None))[0] != written:
            self._read[size] = written, self._loaded(path)
        found = self._read[size][1]
        if found is None:
            raise KeyError(size)
        return found

    def _loaded(self, path: Path) -> IntArray | None:
        try:
            stamp = read_stamp(path)
            if stamp is None or origin(stamp) != origin(self._stamp):
                return None
            with reading(path) as reader:
                found: IntArray = reader.array("subset", 1)
                return found
        except ArtifactError:
            return None

    def __setitem__(self, size: int, subset: IntArray) -> None:
        # Nothing is lost if it cannot be written but time of other jobs.
        with contextlib.suppress(ArtifactError):
            write(self._path(size), self._stamp, lambda writer: writer.dataset("subset", subset))

    def __delitem__(self, size: int) -> None:
        self._path(size).unlink()

    def __iter__(self) -> Iterator[int]:
        found = self._folder.glob(".incumbent-*.h5")
        return iter(sorted(int(path.stem.rpartition("-")[2]) for path in found))

    def __len__(self) -> int:
        return sum(1 for _ in self)
