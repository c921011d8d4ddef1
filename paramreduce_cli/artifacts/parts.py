"""Finished parts of an artifact that is not whole yet."""

import contextlib
from collections.abc import Iterator, MutableMapping
from pathlib import Path
from typing import Any

from paramreduce_cli.artifacts import layouts
from paramreduce_cli.artifacts.hdf5 import Stamp, read_stamp, reading, write
from paramreduce_cli.errors import ArtifactError
from paramreduce_cli.records import Trajectory


class Parts(MutableMapping[str, Trajectory]):
    """Finished trajectories of an artifact that is not whole yet, a file each.

    Parts carry the digest of what they were made from; parts made from anything else are
    ignored and overwritten.

    Args:
        folder: Where they are kept.
        stamp: Provenance of the artifact they will be part of.
    """

    def __init__(self, folder: Path, stamp: Stamp) -> None:
        self._folder = folder
        self._stamp = stamp

    def _path(self, key: str) -> Path:
        return self._folder / f"{key}.h5"

    def __getitem__(self, key: str) -> Trajectory:
        path = self._path(key)
        if not path.exists():
            raise KeyError(key)
        try:
            stamp = read_stamp(path)
            if stamp is None or _origin(stamp) != _origin(self._stamp):
                raise KeyError(key)
            with reading(path) as reader:
                found: Trajectory = layouts.load_table(reader, Trajectory, "part")[0]
                return found
        except ArtifactError as error:
            raise KeyError(key) from error

    def __setitem__(self, key: str, value: Trajectory) -> None:
        write(
            self._path(key),
            self._stamp,
            lambda w: layouts.save_table(w, Trajectory, (value,), "part"),
        )

    def __delitem__(self, key: str) -> None:
        self._path(key).unlink()

    def __iter__(self) -> Iterator[str]:
        return iter(sorted(path.stem for path in self._folder.glob("*.h5")))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def clear(self) -> None:
        """Remove all parts and their folder."""
        for key in list(self):
            del self[key]
        with contextlib.suppress(OSError):
            self._folder.rmdir()


def _origin(stamp: Stamp) -> tuple[Any, ...]:
    return (stamp.schema, stamp.robot, stamp.versions, stamp.sections, stamp.inputs)
