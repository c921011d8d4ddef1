"""Finished parts of an artifact that is not whole yet: trajectories, and shares of a stage's work."""

import contextlib
from collections.abc import Iterator, MutableMapping
from pathlib import Path
from typing import Any

from paramreduce_cli.artifacts import layouts
from paramreduce_cli.artifacts.hdf5 import Stamp, read_stamp, reading, write
from paramreduce_cli.artifacts.places import SHARES
from paramreduce_cli.errors import ArtifactError
from paramreduce_cli.records import Share, Trajectory

_SHARE = "share-"
"""What names of their files begin with."""


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
            if stamp is None or origin(stamp) != origin(self._stamp):
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
        names = (path.stem for path in self._folder.glob("*.h5"))
        return iter(sorted(name for name in names if not name.startswith(_SHARE)))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def clear(self) -> None:
        """Remove all parts and their folder."""
        for key in list(self):
            del self[key]
        with contextlib.suppress(OSError):
            self._folder.rmdir()


class StoredShares:
    """What the jobs of a stage have made, a file each, until it is put together.

    Args:
        path: The artifact that they are shares of.
    """

    def __init__(self, path: Path) -> None:
        self.folder = path.with_name(f"{path.name}{SHARES}")

    def path(self, share: Share) -> Path:
        """Where a share is kept."""
        return self.folder / f"{_SHARE}{share.number:04d}-of-{share.count:04d}.h5"

    def is_finished(self, share: Share, stamp: Stamp) -> bool:
        """Whether a share was made from just this, is whole, and was not cut short by Ctrl-C."""
        known = self._stamp(share)
        return known is not None and not known.cut_short and self.is_usable(share, stamp)

    def is_usable(self, share: Share, stamp: Stamp) -> bool:
        """Whether a share was made from just this, and is whole."""
        known = self._stamp(share)
        if known is None or origin(known) != origin(stamp):
            return False
        try:
            with reading(self.path(share)) as reader:
                reader.verify()
        except ArtifactError:
            return False
        return True

    def _stamp(self, share: Share) -> Stamp | None:
        path = self.path(share)
        try:
            return read_stamp(path) if path.exists() else None
        except ArtifactError:
            return None

    def found(self, stamp: Stamp, command: str) -> list[Path]:
        """Files of all shares, in their order; none where no job has begun.

        Args:
            stamp: What they must have been made from; others are of no concern.
            command: That makes all of it, for messages.

        Raises:
            ArtifactError: Some are missing or damaged.
        """
        counts: dict[int, int] = {}
        for path in self.folder.glob(f"{_SHARE}*-of-*.h5"):
            number = int(path.stem.rpartition("-")[2])
            counts[number] = max(counts.get(number, 0), path.stat().st_mtime_ns)
        for count in sorted(counts, key=lambda n: -counts[n]):
            shares = [Share(number, count) for number in range(1, count + 1)]
            good = [self.is_usable(share, stamp) for share in shares]
            if not any(good):
                continue
            if not all(good):
                wrong = shares[good.index(False)]
                state = "damaged, or of another config" if self.path(wrong).exists() else "missing"
                raise ArtifactError(
                    f"{self.path(wrong)}: part {wrong} is {state} ({good.count(False)} of {count} are). Make it "
                    f"with `paramreduce {command} --part {wrong}`, or do without parts with --force."
                )
            return [self.path(share) for share in shares]
        return []

    def clear(self) -> None:
        """Remove all shares, what was left of killed jobs, and the folder if nothing else is in it."""
        for path in [*self.folder.glob(f"{_SHARE}*"), *self.folder.glob(".*")]:
            path.unlink(missing_ok=True)
        with contextlib.suppress(OSError):
            self.folder.rmdir()


def origin(stamp: Stamp) -> tuple[Any, ...]:
    """What an artifact was made from, and by what."""
    return (stamp.schema, stamp.robot, stamp.versions, stamp.sections, stamp.inputs)
