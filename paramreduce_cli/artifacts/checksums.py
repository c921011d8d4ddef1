"""Datasets with checksums of their rows, block by block, in an attribute.

XXH3 goes through what was just read many times faster than HDF5 reads it; HDF5's own Fletcher-32 takes a third
of the time of reading.
"""

import math
from functools import cached_property
from typing import Any

import h5py
import numpy as np
import xxhash

_ATTRIBUTE = "checks"
_BLOCK = 1 << 16
"""Bytes of rows that a checksum is of."""
_NUMBERS = "fiub"
"""Kinds of arrays that HDF5 reads without h5py."""


class RowChecks:
    """A collector of checksums of rows that are written one block after the other.

    Args:
        row_bytes: Bytes of one row.
    """

    def __init__(self, row_bytes: int) -> None:
        self._rows = _count_block_rows(row_bytes)
        self._hash = xxhash.xxh3_64()
        self._missing = self._rows
        self._values: list[int] = []

    def add(self, rows: np.ndarray) -> None:
        """Add rows to the checksums."""
        rows = np.ascontiguousarray(rows)
        while len(rows):
            some, rows = rows[: self._missing], rows[self._missing :]
            self._hash.update(some.data)
            self._missing -= len(some)
            if self._missing == 0:
                self._end_block()

    def write(self, data: h5py.Dataset) -> None:
        """Write the checksums as an attribute of the dataset."""
        if self._missing < self._rows:
            self._end_block()
        data.attrs[_ATTRIBUTE] = np.array(self._values, dtype=np.uint64)

    def _end_block(self) -> None:
        """Store the checksum of a block, and begin the next block."""
        self._values.append(self._hash.intdigest())
        self._hash.reset()
        self._missing = self._rows


def write_checks(data: h5py.Dataset, array: np.ndarray) -> None:
    """Write the checksums of an array as an attribute of its dataset."""
    checks = RowChecks(_count_row_bytes(array))
    checks.add(array)
    checks.write(data)


class CheckedRows:
    """A dataset that is read in slices of rows; each slice is compared with the dataset's checksums, if there are any.

    The last block stays in memory, because slices mostly follow one another.

    Args:
        identifier: Low-level identifier of the dataset; h5py's own objects take longer than reading small datasets.
    """

    def __init__(self, identifier: h5py.h5d.DatasetID) -> None:
        self._identifier = identifier
        self.shape: tuple[int, ...] = identifier.shape or ()
        self.dtype = identifier.dtype
        self.ndim, self.size = len(self.shape), math.prod(self.shape)
        self.nbytes = self.size * self.dtype.itemsize
        self._checks = _read_checksums(identifier)
        self._rows = _count_block_rows(_count_row_bytes(self)) if self.ndim else 0
        self._kept: tuple[int, np.ndarray] = (-1, np.zeros(0))

    @cached_property
    def _data(self) -> h5py.Dataset:
        return h5py.Dataset(self._identifier)

    def __len__(self) -> int:
        return int(self.shape[0])

    def __getitem__(self, rows: slice) -> np.ndarray:
        start, stop, step = rows.indices(len(self))
        if self._checks is None or stop <= start:
            return np.asarray(self._data[start:stop:step])
        first, last = start // self._rows, -(-stop // self._rows)
        number, kept = self._kept
        parts = []
        if number == first:
            parts.append(kept[start - first * self._rows : stop - first * self._rows].copy())
            first += 1
        if first < last:
            fresh = self._read_blocks(first, last)
            begin = first * self._rows
            parts.append(fresh[max(start - begin, 0) : stop - begin])
            size = min(self._rows, len(self) - (last - 1) * self._rows)
            self._kept = (last - 1, fresh[-size:].copy())
        found = parts[0] if len(parts) == 1 else np.concatenate(parts)
        return found[::step]

    def read_whole(self) -> Any:
        """Return all rows.

        Raises:
            OSError: A checksum does not match.
        """
        if self.dtype.kind in _NUMBERS and self._identifier.shape is not None:
            value = np.empty(self.shape, self.dtype)
            self._identifier.read(h5py.h5s.ALL, h5py.h5s.ALL, value)
        else:
            value = self._data[()]
        if self._checks is not None:
            self._compare_checksums(np.ascontiguousarray(value), 0)
        return value

    def _read_blocks(self, first: int, last: int) -> np.ndarray:
        """Return the rows of some blocks, compared with their checksums."""
        values = np.asarray(self._data[first * self._rows : last * self._rows])
        self._compare_checksums(values, first)
        return values

    def _compare_checksums(self, values: np.ndarray, first: int) -> None:
        """Raise OSError if a block of rows does not match its checksum or has none; only for datasets with checksums."""
        assert self._checks is not None
        for k, start in enumerate(range(0, len(values), self._rows), start=first):
            found = xxhash.xxh3_64_intdigest(values[start : start + self._rows].data)
            if k >= len(self._checks) or found != int(self._checks[k]):
                raise OSError(f"the checksum of {self._data.name} does not fit")


def _read_checksums(identifier: h5py.h5d.DatasetID) -> np.ndarray | None:
    # By hand: h5py's own way to an attribute takes as long as reading a small dataset several times.
    """Return the checksums of a dataset, or None if it has none."""
    name = _ATTRIBUTE.encode()
    if not h5py.h5a.exists(identifier, name):
        return None
    attribute = h5py.h5a.open(identifier, name)
    checks = np.empty(attribute.shape, np.uint64)
    attribute.read(checks)
    return checks


def _count_row_bytes(array: Any) -> int:
    return math.prod(array.shape[1:]) * int(array.dtype.itemsize)


def _count_block_rows(row_bytes: int) -> int:
    return max(1, _BLOCK // max(1, row_bytes))
