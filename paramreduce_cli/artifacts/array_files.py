"""Arrays of NumPy, HDF5 and MATLAB files, read as columns by name."""

import lzma
import tokenize
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy  # its io takes a while to load, so only when it is used

from paramreduce_cli.artifacts.atomic import check_is_file, make_missing_error
from paramreduce_cli.artifacts.hdf5 import open_reader
from paramreduce_cli.errors import ArtifactError, DataError
from paramreduce_cli.records import FloatArray, RawLog
from paramreduce_cli.resources.scratch import allocate_matrix

_MOST_COLUMNS = 64
"""Columns of a matrix beyond which they are samples, where rows are fewer."""
_AT_ONCE = 1 << 16
"""Rows."""
_UNREADABLE = (
    OSError, EOFError, ValueError, TypeError, RuntimeError, MemoryError,
    zipfile.BadZipFile, zlib.error, lzma.LZMAError, tokenize.TokenError,
)  # fmt: skip
"""What damage, encryption and odd headers raise."""
_HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
"""Readers of what NumPy writes before the numbers of an array, by version."""
_NUMBERS = "numbers"
_KINDS = {"c": "complex numbers", "b": "true and false", "S": "text", "U": "text", "O": "text"}
"""What arrays hold by NumPy's kind of their type, where it is no real number."""


def load_hdf5(path: Path) -> RawLog:
    """Return the datasets of an HDF5 file as a log."""
    return _read_datasets(path, transposed=False)


def _read_datasets(path: Path, *, transposed: bool) -> RawLog:
    """Return the datasets of an HDF5 file as a log; with ``transposed`` matrices are stored as MATLAB stores them."""
    with open_reader(path) as reader:
        names: list[str] = []
        reader.file.visit(names.append)
        kinds = {name: _classify_dataset(reader.file[name]) for name in names}
        numeric = [name for name, kind in kinds.items() if kind == _NUMBERS]
        others = {name: kind for name, kind in kinds.items() if kind not in ("", _NUMBERS)}
        matrices = ((name, _read_columns(reader.open_rows(name))) for name in numeric)
        if transposed:
            matrices = ((name, matrix.T) for name, matrix in matrices)
        return _split_columns(path, matrices, others)


def load_matlab(path: Path) -> RawLog:
    """Return the arrays of a MATLAB file as a log, those in structures as ``STRUCTURE/ARRAY``.

    Raises:
        ArtifactError: The file is missing or no MATLAB file.
    """
    check_is_file(path)
    try:
        if h5py.is_hdf5(path):  # version 7.3
            return _read_datasets(path, transposed=True)
        held = scipy.io.loadmat(str(path), squeeze_me=True, struct_as_record=False)
        arrays = dict(_iterate_fields(held))
    except FileNotFoundError as error:
        raise make_missing_error(path) from error
    except (*_UNREADABLE, scipy.io.matlab.MatReadError) as error:
        raise ArtifactError(f"{path}: cannot be read as a MATLAB file ({error}).") from error
    numbers = {name: array for name, array in arrays.items() if array.dtype.kind in "fiu"}
    others = {
        name: _KINDS.get(array.dtype.kind, "no numbers")
        for name, array in arrays.items()
        if name not in numbers
    }
    return _split_columns(
        path, ((name, _read_columns(array)) for name, array in numbers.items()), others
    )


def _iterate_fields(held: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, np.ndarray]]:
    """Yield the arrays of one or two dimensions in MATLAB's variables and structures, by name."""
    for key, value in held.items():
        if key.startswith("__"):
            continue
        if isinstance(value, np.ndarray):
            if value.ndim in (1, 2) and value.size:
                yield f"{prefix}{key}", value
        elif hasattr(value, "_fieldnames"):
            fields = {name: getattr(value, name) for name in value._fieldnames}
            yield from _iterate_fields(fields, f"{prefix}{key}/")


def load_npy(path: Path) -> RawLog:
    """Return the columns of one array, numbered from 1, as a log.

    Raises:
        ArtifactError: The file is missing or no array of numbers.
    """
    check_is_file(path)
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
        if array.dtype.names is not None:
            return _split_columns(path, ((n, _read_columns(array[n])) for n in array.dtype.names))
        if array.ndim != 2 or array.dtype.kind not in "fiu":
            raise ValueError(f"its shape is {array.shape}, its type {array.dtype}")
        return _split_columns(path, [("", _read_columns(array))])
    except FileNotFoundError as error:
        raise make_missing_error(path) from error
    except _UNREADABLE as error:
        raise ArtifactError(f"{path}: cannot be read as an array of columns ({error}).") from error


def _classify_dataset(item: Any) -> str:
    """Return the kind of a dataset's entries; empty for a group, or a dataset without rows."""
    kind = getattr(getattr(item, "dtype", None), "kind", "")
    if kind == "" or item.ndim not in (1, 2):
        return ""
    return _NUMBERS if kind in "fiu" else _KINDS.get(kind, "no numbers")


def _read_columns(rows: Any) -> FloatArray:
    """Return an array, (n_rows,) or (n_rows, n), as a matrix of contiguous columns; it is read some rows at a time."""
    result = allocate_matrix(rows.shape[0], rows.shape[1] if rows.ndim == 2 else 1)
    for start in range(0, len(result), _AT_ONCE):
        some = rows[start : start + _AT_ONCE]
        result[start : start + _AT_ONCE] = some.reshape(len(some), -1)
    return result


def load_npz(path: Path) -> RawLog:
    """Return the arrays of an NPZ file as a log.

    Raises:
        ArtifactError: The file is missing or no NPZ file.
    """
    check_is_file(path)
    try:
        with zipfile.ZipFile(path) as archive:
            others: dict[str, str] = {}
            return _split_columns(path, _iterate_members(archive, others), others)
    except FileNotFoundError as error:
        raise make_missing_error(path) from error
    except _UNREADABLE as error:
        raise ArtifactError(f"{path}: cannot be read as NPZ ({error}).") from error


def _iterate_members(
    archive: zipfile.ZipFile, others: dict[str, str]
) -> Iterator[tuple[str, FloatArray]]:
    """Yield the arrays of numbers in an archive; numpy.load would need memory for each of them.

    Args:
        archive: The file.
        others: Mapping to which a description of each array without numbers is added, by name.

    Raises:
        ValueError: An array is shorter or longer than its header says.
    """
    for info in archive.infolist():
        with archive.open(info) as file:
            version = np.lib.format.read_magic(file)
            if version not in _HEADERS:  # of text in many alphabets
                continue
            shape, by_column, kind = _HEADERS[version](file)
            if kind.kind in _KINDS:
                others[info.filename.removesuffix(".npy")] = _KINDS[kind.kind]
            if kind.kind not in "fiu" or len(shape) not in (1, 2):
                continue
            n_rows, n_columns = (*shape, 1)[:2]
            if n_rows == 0:
                continue
            if n_rows * n_columns * kind.itemsize != info.file_size - file.tell():
                raise ValueError(f"{info.filename} does not hold the {shape} numbers it declares")
            result = allocate_matrix(n_rows, n_columns)
            # Numbers follow each other row by row, or column by column.
            lines = result.T if by_column else result
            at_once = 1 if by_column else _AT_ONCE
            for start in range(0, len(lines), at_once):
                part = lines[start : start + at_once]
                numbers = np.frombuffer(file.read(part.size * kind.itemsize), kind)
                part[:] = numbers.reshape(part.shape)
            yield info.filename.removesuffix(".npy"), result


def _split_columns(
    path: Path, matrices: Iterable[tuple[str, FloatArray]], others: Mapping[str, str] | None = None
) -> RawLog:
    """Return a log whose columns are the numbered columns of matrices.

    Args:
        path: The file.
        matrices: Names and arrays, (n_rows, n_columns) each.
        others: Descriptions of the datasets without numbers, by name.

    Raises:
        DataError: There are no numbers, or a matrix has its samples in columns.
    """
    found = dict(matrices)
    lengths = {matrix.shape[0] for matrix in found.values() if matrix.shape[1] == 1}
    columns: dict[str, FloatArray] = {}
    for name, matrix in found.items():
        if matrix.shape[1] in lengths and matrix.shape[0] not in lengths:
            matrix = matrix.T  # joints x samples, as single columns tell
        if matrix.shape[1] == 1:
            columns[name] = matrix[:, 0]
        elif matrix.shape[1] > _MOST_COLUMNS and matrix.shape[0] < matrix.shape[1]:
            raise DataError(
                f"{path}: {name} has {matrix.shape[0]} rows and {matrix.shape[1]} columns. Store it with a row for each "
                "sample."
            )
        else:
            columns |= {f"{name}{k + 1}": column for k, column in enumerate(matrix.T)}
    if not columns:
        held = "".join(f" {name} holds {kind}." for name, kind in (others or {}).items())
        raise DataError(f"{path}: holds no columns of numbers.{held}")
    return RawLog(str(path), columns, first_line=None, others=others or {})
