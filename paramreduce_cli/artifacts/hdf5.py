"""HDF5 files with provenance: written whole, checked as they are read.

Every byte that means something has a checksum that is compared whenever it is read: large arrays one for
each block of rows, and what is small stands with names, shapes and attributes in headers,
which HDF5 checks by itself from version 1.10 of its format on. Text is of fixed length, as HDF5
does not check the heap where other text goes.
"""

import contextlib
import dataclasses
import hashlib
import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from paramreduce_cli.artifacts.atomic import (
    PatientFile,
    check_is_file,
    make_missing_error,
    replace_atomically,
)
from paramreduce_cli.artifacts.checksums import CheckedRows, RowChecks, write_checks
from paramreduce_cli.errors import ArtifactError

SCHEMA = 22
"""Version of the layout of all artifacts; raised whenever a name, shape or unit changes."""

_CHUNK = 16384
"""Numbers in a chunk of a dataset that grows: 128 KiB."""
_WRITTEN_AT_ONCE = 4 * _CHUNK
"""Numbers of rows that wait to be written together: a call of HDF5 takes long for a few."""
_CHUNK_CACHE = 1 << 20
"""Bytes that HDF5 keeps of each dataset; all are read and written in order."""
_FORMAT = ("v110", "v110")
_SMALL = 8192
"""Bytes that a header has room for."""
_LARGEST_HEADER = 60_000
"""Bytes that a header can be made to hold; text beyond that is an array with one entry."""
_AT_ONCE = 1 << 24
"""Bytes that are read or written of a large dataset."""
_STRETCH = 1 << 20
"""Bytes that are read together of rows that are read one after the other."""
_MOST_COMPRESSED = 1000
"""A dataset that declares more numbers for what it holds is none that was written."""


@dataclass(frozen=True)
class Stamp:
    """The attributes that every artifact carries."""

    schema: int
    robot: str
    stage: str
    versions: dict[str, str]
    """paramreduce, numpy, scipy and casadi."""
    sections: dict[str, str]
    """Digest of every config section the stage read."""
    inputs: dict[str, str]
    """Digest of every file the stage read, by its name."""
    seed: int
    seconds: float
    digest: str = ""
    """Digest of all datasets; set when the file is complete."""
    cut_short: bool = False
    """Whether Ctrl-C ended a search in it, with which the next run goes on."""
    warnings: tuple[str, ...] = ()
    """Warnings of the stage."""
    config: str = ""
    """Name of the config's file; empty where there was none, or where it was not started at the shell."""


class Writer:
    """A writer of datasets that computes a digest of all that it writes.

    Args:
        group: Group to write to.
        check: Raises an error that an earlier write has met.
    """

    def __init__(self, group: h5py.Group, check: Callable[[], None]) -> None:
        self._group = group
        self._check = check
        self._hash = hashlib.sha256()
        self._ends: list[Callable[[], None]] = []

    @property
    def digest(self) -> str:
        """Digest of everything written so far."""
        return self._hash.hexdigest()

    def write_timing(self, name: str, value: Any) -> None:
        """Write how long something took, which is left out of the digest."""
        self._store(name, np.asarray(value))

    def write_dataset(self, name: str, value: Any) -> None:
        """Write an array, a number, a text or a list of texts."""
        array = np.asarray(value)
        if array.dtype.kind not in "US":
            if array.nbytes > _AT_ONCE and array.ndim:
                self._store_in_parts(name, array)
                return
            self._update_digest(name, np.ascontiguousarray(array).tobytes())
            self._store(name, array)
            return
        flat = [str(item).encode() for item in array.ravel()]
        self._update_digest(name, b"\0".join(flat))
        kind = h5py.string_dtype(length=max(1, *map(len, flat)) if flat else 1)
        self._store(name, np.array(flat, dtype=kind).reshape(array.shape))

    def write_attribute(self, name: str, value: Any) -> None:
        """Write a small attribute of the file."""
        self._update_digest(name, repr(value).encode())
        write_attribute(self._group, name, value)

    def _store_in_parts(self, name: str, array: np.ndarray) -> None:
        """Store an array that may be larger than memory, some rows at a time."""
        data = self._group.create_dataset(name, array.shape, array.dtype)
        checks = RowChecks(array.nbytes // max(1, len(array)))
        self._hash.update(name.encode())
        step = max(1, _AT_ONCE * len(array) // array.nbytes)
        for start in range(0, len(array), step):
            rows = np.ascontiguousarray(array[start : start + step])
            self._check()
            self._hash.update(rows.data)
            checks.add(rows)
            data[start : start + step] = rows
        checks.write(data)

    def _store(self, name: str, array: np.ndarray) -> None:
        """Store an array with checksums, or in the header if it is small."""
        if array.nbytes > _LARGEST_HEADER and array.shape == ():
            array = array[None]
        if array.nbytes > (_SMALL if array.shape else _LARGEST_HEADER):
            write_checks(self._group.create_dataset(name, data=array), array)
            return
        # By hand, as h5py never asks HDF5 to put a scalar into a header.
        layout = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        layout.set_layout(h5py.h5d.COMPACT)
        links = h5py.h5p.create(h5py.h5p.LINK_CREATE)
        links.set_create_intermediate_group(True)
        kind = h5py.h5t.py_create(array.dtype, logical=True)
        space = (
            h5py.h5s.create_simple(array.shape) if array.shape else h5py.h5s.create(h5py.h5s.SCALAR)
        )
        made = h5py.h5d.create(self._group.id, name.encode(), kind, space, layout, links)
        if array.size:
            h5py.Dataset(made)[...] = array

    def start_rows(self, name: str, columns: int | None) -> Callable[[np.ndarray], None]:
        """Return a function that appends blocks of rows to a new dataset.

        Args:
            name: Name of the dataset.
            columns: Width of a row; None for a vector.

        Returns:
            A function that appends a block.
        """
        tail = () if columns is None else (columns,)
        chunk = max(1, _CHUNK // max(1, columns or 1))
        data = self._group.create_dataset(
            name, shape=(0, *tail), maxshape=(None, *tail), chunks=(chunk, *tail), dtype="f8"
        )
        checks = RowChecks(8 * (columns or 1))

        waiting: list[np.ndarray] = []
        enough = max(1, _WRITTEN_AT_ONCE // max(1, columns or 1))
        count = 0

        def write_waiting() -> None:
            """Write the waiting blocks to the dataset."""
            nonlocal count
            if waiting:
                start = data.shape[0]
                data.resize(start + count, axis=0)
                rows = np.concatenate(waiting)
                data[start:] = rows
                checks.add(rows)
                waiting.clear()
                count = 0

        def finish() -> None:
            """Write the waiting blocks, then the checksums of the dataset."""
            write_waiting()
            checks.write(data)

        def append(block: np.ndarray) -> None:
            """Add a block to the waiting ones, and write them if they are many."""
            self._update_digest(name, np.ascontiguousarray(block).tobytes())
            nonlocal count
            waiting.append(np.array(block, dtype=float))
            count += len(block)
            if count >= enough:
                write_waiting()

        self._ends.append(finish)
        return append

    def finish(self) -> None:
        """Write the rows that were buffered."""
        for end in self._ends:
            end()
        self._check()

    def _update_digest(self, name: str, content: bytes) -> None:
        """Add content to the digest."""
        self._check()
        self._hash.update(name.encode())
        self._hash.update(content)


def write(path: Path, stamp: Stamp, fill: Callable[[Writer], None]) -> Stamp:
    """Write an artifact as a whole.

    Args:
        path: Destination; an older file stays until the new one is complete.
        stamp: Provenance of the artifact.
        fill: Function that writes the contents.

    Returns:
        The stamp with the digest of the contents.

    Raises:
        ArtifactError: The file cannot be written.
    """
    started = time.perf_counter()
    with replace_atomically(path) as temporary, contextlib.closing(PatientFile(temporary)) as disk:
        with h5py.File(disk, "w", libver=_FORMAT, rdcc_nbytes=_CHUNK_CACHE) as file:
            writer = Writer(file, disk.check)
            fill(writer)
            writer.finish()
            seconds = stamp.seconds + time.perf_counter() - started
            done = dataclasses.replace(stamp, digest=writer.digest, seconds=seconds)
            for name, value in _list_attributes(done).items():
                write_attribute(file, name, value)
        disk.check()
    return done


def write_attribute(group: h5py.Group, name: str, value: Any) -> None:
    """Write an attribute; text of fixed length."""
    if isinstance(value, str):
        value = np.array(
            value.encode(), dtype=h5py.string_dtype(length=max(1, len(value.encode())))
        )
    group.attrs[name] = value


class Reader:
    """A reader of an artifact; missing or wrong datasets raise ArtifactError."""

    def __init__(self, path: Path, file: h5py.File) -> None:
        self.path = path
        self.file = file
        self._attributes = file.attrs
        self._inside: set[str] = set()
        """Places that no link to another file leads to."""

    def __contains__(self, name: str) -> bool:
        return name in self.file

    def read_array(self, name: str, dimensions: int | None = None) -> np.ndarray:
        """Return a numeric dataset as a whole.

        Raises:
            ArtifactError: The dataset is missing, not of numbers, or has another number of dimensions.
        """
        value = np.asarray(self._open_dataset(name).read_whole())
        if value.dtype.kind not in "fiub":
            raise ArtifactError(f"{self.path}: /{name} must hold numbers.")
        if dimensions is not None and value.ndim != dimensions:
            raise ArtifactError(
                f"{self.path}: /{name} has {value.ndim} dimensions where {dimensions} are needed."
            )
        return value

    def read_texts(self, name: str) -> tuple[str, ...]:
        """Return a dataset of texts.

        Raises:
            ArtifactError: The dataset is missing or not of text.
        """
        data = self._open_dataset(name)
        if not h5py.check_string_dtype(data.dtype) and data.size:
            raise ArtifactError(f"{self.path}: /{name} must hold text.")
        values = np.atleast_1d(data.read_whole())
        return tuple(v.decode() if isinstance(v, bytes) else str(v) for v in values)

    def read_text(self, name: str) -> str:
        """Return a dataset with one text."""
        return self.read_texts(name)[0]

    def read_attribute(self, name: str, default: Any = None) -> Any:
        """Return an attribute of the file."""
        value = self._attributes.get(name, default)
        value = value.item() if isinstance(value, np.generic) else value
        return value.decode() if isinstance(value, bytes) else value

    def open_rows(self, name: str) -> CheckedRows:
        """Return a numeric dataset that is read in slices of rows.

        Raises:
            ArtifactError: The dataset is missing or no array of real numbers.
        """
        data = self._open_dataset(name)
        if data.dtype.kind not in "fiu" or data.ndim == 0:
            raise ArtifactError(f"{self.path}: /{name} must hold an array of real numbers.")
        return data

    def verify(self) -> None:
        """Read the whole file, which compares all checksums.

        Raises:
            ArtifactError: A checksum does not match.
        """
        for name in self._attributes:
            self.read_attribute(name)
        self.file.visititems(self._verify_item)

    def _verify_item(self, name: str, item: h5py.Group | h5py.Dataset) -> None:
        """Read an item of the file to compare its checksums."""
        if not isinstance(item, h5py.Dataset):
            return
        data = self._check_dataset(name, item.id)
        if not data.ndim:
            data.read_whole()
            return
        step = max(1, _AT_ONCE * len(data) // max(1, data.nbytes))
        for start in range(0, len(data), step):
            data[start : start + step]

    def _open_dataset(self, name: str) -> CheckedRows:
        # Through HDF5's own functions: h5py's objects take longer than reading a small dataset.
        """Return a dataset, or raise ArtifactError if there is none."""
        try:
            self._reject_other_files(name)
            found = h5py.h5o.open(self.file.id, name.encode())
        except (KeyError, RuntimeError):
            found = None
        if not isinstance(found, h5py.h5d.DatasetID):
            self.verify()  # a damaged group hides what is in it
            raise ArtifactError(
                f"{self.path}: /{name} is missing. See docs/artifacts.md for what it must hold."
            )
        return self._check_dataset(name, found)

    def _reject_other_files(self, name: str) -> None:
        """Raise ArtifactError if a name leads into another file."""
        parts = name.split("/")
        for k in range(len(parts)):
            place = "/".join(parts[: k + 1])
            if place in self._inside:
                continue
            if self.file.id.links.get_info(place.encode()).type == h5py.h5l.TYPE_EXTERNAL:
                raise ArtifactError(
                    f"{self.path}: /{name} is in another file; copy it into this one."
                )
            self._inside.add(place)

    def _check_dataset(self, name: str, dataset: h5py.h5d.DatasetID) -> CheckedRows:
        """Return a dataset if its numbers are in this file and complete.

        Raises:
            ArtifactError: The dataset's numbers are in another file, or missing.
        """
        properties = dataset.get_create_plist()
        layout = properties.get_layout()
        outside = layout == h5py.h5d.CONTIGUOUS and properties.get_external_count()
        if layout == h5py.h5d.VIRTUAL or outside:
            raise ArtifactError(f"{self.path}: /{name} is in another file; copy it into this one.")
        data = CheckedRows(dataset)
        if data.nbytes > _SMALL + _MOST_COMPRESSED * dataset.get_storage_size():
            raise ArtifactError(
                f"{self.path}: /{name} declares {' x '.join(map(str, data.shape))} numbers, but holds almost none."
            )
        return data


class StoredRows:
    """A numeric dataset in a file, of which forward slices are read. It becomes an array where NumPy needs one.

    Args:
        reader: Reader of the file.
        name: Name of the dataset.
    """

    def __init__(self, reader: Reader, name: str) -> None:
        data = reader.open_rows(name)
        self._path, self._name = reader.path, name
        self.shape, self.dtype, self.ndim, self.size = data.shape, data.dtype, data.ndim, data.size
        self._first = 0
        self._stretch: np.ndarray = np.zeros((0, *self.shape[1:]), self.dtype)

    def __len__(self) -> int:
        return int(self.shape[0])

    def __getitem__(self, rows: slice) -> np.ndarray:
        start, stop, step = rows.indices(len(self))
        stop = max(start, stop)
        if step < 1:
            raise ValueError("rows are read forwards")
        last = self._first + len(self._stretch)
        if not self._first <= start <= stop <= last:
            # Slices follow each other: the next ones are read with this one.
            size = max(1, _STRETCH * len(self) // (self.size * self.dtype.itemsize))
            with open_reader(self._path) as reader:
                self._stretch = reader.open_rows(self._name)[start : max(stop, start + size)]
            self._first = start
        return self._stretch[start - self._first : stop - self._first : step]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        with open_reader(self._path) as reader:
            return reader.read_array(self._name).astype(dtype or self.dtype, copy=False)


@contextlib.contextmanager
def open_reader(path: Path, *, command: str = "", remedy: str = "") -> Iterator[Reader]:
    """Open an HDF5 file for reading within the block.

    Args:
        path: The file.
        command: Stage that makes the file, for messages.
        remedy: Sentence on what the file is needed for.

    Raises:
        ArtifactError: The file is missing, truncated or no HDF5 file.
    """
    if not path.exists():
        raise make_missing_error(path, command=command, remedy=remedy)
    check_is_file(path)
    try:
        file = h5py.File(path, "r", rdcc_nbytes=_CHUNK_CACHE)
    except OSError as error:
        raise ArtifactError(
            f"{path}: is not a readable HDF5 file (truncated, or of another kind).",
            rejected=str(path), command=command, remedy=remedy,
        ) from error  # fmt: skip
    with file:
        try:
            yield Reader(path, file)
        except (OSError, KeyError, RuntimeError, ValueError, TypeError, MemoryError) as error:
            raise ArtifactError(
                f"{path}: is damaged: {error}.", rejected=str(path), command=command, remedy=remedy
            ) from error


def _list_attributes(stamp: Stamp) -> dict[str, Any]:
    """Return the attributes of a file's stamp by name."""
    return {
        "schema": stamp.schema,
        "robot": stamp.robot,
        "stage": stamp.stage,
        "paramreduce_version": stamp.versions["paramreduce"],
        "numpy_version": stamp.versions["numpy"],
        "scipy_version": stamp.versions["scipy"],
        "casadi_version": stamp.versions["casadi"],
        "config_sections": json.dumps(stamp.sections, sort_keys=True),
        "inputs": json.dumps(stamp.inputs, sort_keys=True),
        "seed": stamp.seed,
        "wall_seconds": stamp.seconds,
        "digest": stamp.digest,
        "cut_short": stamp.cut_short,
        "config": stamp.config,
        "warnings": json.dumps(stamp.warnings),
    }


def read_stamp(path: Path) -> Stamp | None:
    """Return the stamp of a file, or None if the file is no artifact of this project."""
    with open_reader(path) as reader:
        return read_stamp_from(reader)


def read_stamp_from(reader: Reader) -> Stamp | None:
    """Return the stamp of an open file, or None if the file is no artifact of this project."""
    if reader.read_attribute("schema") is None or reader.read_attribute("stage") is None:
        return None
    return Stamp(
        schema=int(reader.read_attribute("schema")),
        robot=str(reader.read_attribute("robot")),
        stage=str(reader.read_attribute("stage")),
        versions={
            name: str(reader.read_attribute(f"{name}_version", "?"))
            for name in ("paramreduce", "numpy", "scipy", "casadi")
        },
        sections=json.loads(reader.read_attribute("config_sections", "{}")),
        inputs=json.loads(reader.read_attribute("inputs", "{}")),
        seed=int(reader.read_attribute("seed", 0)),
        seconds=float(reader.read_attribute("wall_seconds", 0.0)),
        digest=str(reader.read_attribute("digest", "")),
        cut_short=bool(reader.read_attribute("cut_short", False)),
        config=str(reader.read_attribute("config", "")),
        warnings=tuple(json.loads(reader.read_attribute("warnings", "[]"))),
    )
