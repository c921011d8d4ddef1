"""Finished items of an artifact that is not complete yet, one file each."""

import contextlib
import time
from collections.abc import Callable, Iterator, MutableMapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from paramreduce_cli.artifacts import layouts
from paramreduce_cli.artifacts.atomic import remove_leftovers
from paramreduce_cli.artifacts.folder_layout import ITEMS
from paramreduce_cli.artifacts.hdf5 import Reader, Stamp, Writer, open_reader, read_stamp, write
from paramreduce_cli.artifacts.sample_files import load_item_set, save_sample_set
from paramreduce_cli.errors import ArtifactError
from paramreduce_cli.records import ProofItem, TermModel, Trajectory

_KIND = "kind"
"""Attribute that names the kind of record in a file."""
_RECORDS = {record.__name__: record for record in (Trajectory, TermModel, ProofItem)}
_NOTHING, _ARRAY, _SET = "nothing", "array", "samples"
_GROUP = "item"


class StoredItems(MutableMapping[str, Any]):
    """A mapping of finished items by key, stored as files.

    Each item carries the digests of the inputs that it was made from. An item that is damaged, or made from other
    inputs, counts as absent.

    Args:
        path: Path of the artifact that the items belong to.
        stamp: Function that returns the stamp of an item, given the seconds that the item took.
        from_start: Whether items of earlier runs count as absent.
        check: Called before an item is written; raises a KeyboardInterrupt that a library swallowed, which may
            have spoilt the item.
    """

    def __init__(
        self,
        path: Path,
        stamp: Callable[[float], Stamp],
        *,
        from_start: bool = False,
        check: Callable[[], None] = lambda: None,
    ) -> None:
        self.folder = path.with_name(f"{path.name}{ITEMS}")
        """Folder of the items."""
        self._stamp = stamp
        self._since = time.perf_counter()
        self._read: dict[str, tuple[int, Any]] = {}
        self._from_start, self._check = from_start, check
        self.written: set[str] = set()
        """Keys of the items that this run has finished."""

    def _get_path(self, key: str) -> Path:
        return self.folder / f"{key}.h5"

    def __getitem__(self, key: str) -> Any:
        path = self._get_path(key)
        if self._from_start and key not in self.written:
            raise KeyError(key)
        try:
            written = path.stat().st_mtime_ns
        except OSError as error:
            raise KeyError(key) from error
        if self._read.get(key, (0, None))[0] != written:
            self._read[key] = written, self._load_item(key)
        record = self._read[key][1]
        if isinstance(record, _Absent):
            raise KeyError(key)
        return record

    def _load_item(self, key: str) -> Any:
        """Return the item in a file, or _Absent if it is damaged or of another origin."""
        path = self._get_path(key)
        try:
            stamp = read_stamp(path)
            if stamp is None or _get_origin(stamp) != self._own_origin:
                return _Absent()
            with open_reader(path) as reader:
                reader.verify()
                return _load_record(reader)
        except ArtifactError:
            return _Absent()

    @cached_property
    def _own_origin(self) -> tuple[Any, ...]:
        return _get_origin(self._stamp(0.0))

    def __setitem__(self, key: str, record: Any) -> None:
        self._check()
        now = time.perf_counter()
        stamp = self._stamp(now - self._since)
        self._since = now
        write(self._get_path(key), stamp, lambda writer: _save_record(writer, record))
        self.written.add(key)

    def __delitem__(self, key: str) -> None:
        self._get_path(key).unlink()

    def __iter__(self) -> Iterator[str]:
        names = (path.stem for path in self.folder.glob("*.h5"))
        return iter(sorted(name for name in names if not name.startswith(".")))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def list_stamps(self) -> list[Stamp]:
        """Return the stamps of the items that have the same origin as the artifact."""
        found: list[Stamp] = []
        for key in [] if self._from_start else self:
            with contextlib.suppress(ArtifactError):
                stamp = read_stamp(self._get_path(key))
                if stamp is not None and _get_origin(stamp) == self._own_origin:
                    found.append(stamp)
        return found

    def clear(self) -> None:
        """Remove all items, the temporary files of killed jobs, and the folder unless a running job writes to it."""
        for path in self.folder.glob("*.h5"):
            path.unlink(missing_ok=True)
        remove_leftovers(self.folder)
        with contextlib.suppress(OSError):
            self.folder.rmdir()


class _Absent:
    """A marker of an item that is damaged or of another origin."""


def _get_origin(stamp: Stamp) -> tuple[Any, ...]:
    """Return the origin of a file: versions, and digests of sections and inputs."""
    return (stamp.schema, stamp.robot, stamp.versions, stamp.sections, stamp.inputs)


def _save_record(writer: Writer, record: Any) -> None:
    """Write an item in the format of its type."""
    kind = type(record).__name__
    if record is None:
        writer.write_attribute(_KIND, _NOTHING)
    elif isinstance(record, np.ndarray):
        writer.write_attribute(_KIND, _ARRAY)
        writer.write_dataset(_GROUP, record)
    elif kind in _RECORDS:
        writer.write_attribute(_KIND, kind)
        layouts.save(writer, record, _GROUP)
    else:
        writer.write_attribute(_KIND, _SET)
        save_sample_set(writer, _GROUP, record)


def _load_record(reader: Reader) -> Any:
    """Return an item, read in the format of its type."""
    kind = reader.read_attribute(_KIND)
    if kind == _NOTHING:
        return None
    if kind == _ARRAY:
        return reader.read_array(_GROUP)
    if kind in _RECORDS:
        return layouts.load(reader, _RECORDS[kind], _GROUP)
    return load_item_set(reader, _GROUP)
