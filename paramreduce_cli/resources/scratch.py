"""Matrices that may be larger than memory, kept in temporary files from some size on.

The file is in the folder that ``TMPDIR`` names, else in ``/var/tmp``, which unlike ``/tmp`` is on a disk. What is in
it is mapped, so that the system takes back the memory where it is short.
"""

import array
import os
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from paramreduce_cli.errors import DataError

_LARGE = 1 << 26
"""Bytes from which on a matrix is kept in a file."""
_WAITING = 1 << 16
"""Numbers that are written to the file at once."""


def allocate_matrix(n_rows: int, n_columns: int) -> NDArray[np.float64]:
    """Return an uninitialised matrix, (n_rows, n_columns), in column order, in a mapped temporary file if it is large."""
    shape = (n_columns, n_rows)
    size = 8 * n_rows * n_columns
    if size >= _LARGE and hasattr(os, "posix_fallocate"):
        try:
            with tempfile.TemporaryFile(dir=_find_temporary_folder()) as file:
                # A disk that is full later would end the process.
                os.posix_fallocate(file.fileno(), 0, size)
                mapped = np.memmap(file, dtype=np.float64, mode="r+", shape=shape)
            return np.asarray(mapped).T
        except OSError:
            pass  # no room: memory may do
    return np.empty(shape).T


def stack_columns(columns: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return a matrix of columns, (n_rows,) each, in a mapped file if it is large."""
    result = allocate_matrix(columns[0].size, len(columns))
    for j, column in enumerate(columns):
        result[:, j] = column
    return result


def stack_rows(parts: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return matrices, (n_rows, n_columns) each, one below the other; a single matrix is returned as it is."""
    if len(parts) == 1:
        return parts[0]
    result = allocate_matrix(sum(map(len, parts)), parts[0].shape[1])
    start = 0
    for part in parts:
        result[start : start + len(part)] = part
        start += len(part)
    return result


class LargeTable:
    """A table of numbers that is extended row by row, in a temporary file; the number of rows need not be known."""

    def __init__(self) -> None:
        self._size = 0
        self._waiting = array.array("d")
        self._file = tempfile.SpooledTemporaryFile(max_size=_LARGE, dir=_find_temporary_folder())  # noqa: SIM115

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def __bool__(self) -> bool:
        """Return whether the table holds any number."""
        return self._size > 0

    def extend(self, numbers: Iterable[float]) -> None:
        """Append numbers to the table."""
        before = len(self._waiting)
        self._waiting.extend(numbers)
        self._size += len(self._waiting) - before
        if len(self._waiting) > _WAITING:
            self._flush()

    def _flush(self) -> None:
        """Write the buffered numbers to the file, or raise DataError if the disk is full."""
        try:
            self._file.write(self._waiting.tobytes())
        except OSError as error:
            raise DataError(
                f"{_find_temporary_folder() or tempfile.gettempdir()}: no space for temporary data larger than memory "
                f"({error.strerror}). Set TMPDIR to another folder."
            ) from error
        del self._waiting[:]

    def to_matrix(self, n_columns: int) -> NDArray[np.float64]:
        """Return all numbers as a matrix, (n_rows, n_columns)."""
        self._flush()
        self._file.seek(0)
        result = allocate_matrix(self._size // max(1, n_columns), n_columns)
        rows = max(1, _WAITING // max(1, n_columns))
        for start in range(0, len(result), rows):
            part = result[start : start + rows]
            part[:] = np.frombuffer(self._file.read(8 * part.size)).reshape(part.shape)
        return result


def _find_temporary_folder() -> str | None:
    """Return ``/var/tmp``, or None for Python's own choice if ``TMPDIR`` is set or the folder is not writable."""
    usual = Path("/var/tmp")
    if "TMPDIR" in os.environ or not os.access(usual, os.W_OK):
        return None
    return str(usual)
