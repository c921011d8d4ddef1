"""Logs as people have them: CSV, HDF5, NPZ and ROS 2 bags, all as columns by name."""

import array
import lzma
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from paramreduce_cli.artifacts.atomic import check_is_file, missing
from paramreduce_cli.artifacts.csv_files import read_csv
from paramreduce_cli.artifacts.hdf5 import Reader, reading
from paramreduce_cli.errors import ArtifactError, DataError
from paramreduce_cli.records import FloatArray, RawLog
from paramreduce_cli.scratch import large_matrix

_BAGS = (".db3", ".mcap")
_HDF5 = (".h5", ".hdf5")
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


def load_log(path: Path) -> RawLog:
    """Read a log.

    Args:
        path: CSV (also .gz) with a line of headings; HDF5 or NPZ with a dataset for each column, or
            matrices, whose columns are numbered from 1; a ROS 2 bag, as a folder or a file.

    Raises:
        DataError: It holds no columns of numbers.
        ArtifactError: It cannot be read.
    """
    if path.is_dir() or path.suffix in _BAGS:
        return _bag(path)
    if path.suffix in _HDF5:
        with reading(path) as reader:
            names: list[str] = []
            reader.file.visit(names.append)
            numeric = [name for name in names if _is_numeric(reader.file[name])]
            return _from_arrays(path, ((name, _read(reader, name)) for name in numeric))
    if path.suffix == ".npz":
        return _npz(path)
    header, table = read_csv(path, leave_out_text=True)
    columns = dict(zip(header, table.T, strict=True))
    return RawLog(str(path), columns, first_line=2)


def _is_numeric(item: Any) -> bool:
    kind = getattr(getattr(item, "dtype", None), "kind", "")
    return kind != "" and kind in "fiub" and item.ndim in (1, 2)


def _read(reader: Reader, name: str) -> FloatArray:
    if reader.file[name].dtype.kind == "b":
        return _columns(reader.array(name).astype(float))
    return _columns(reader.rows(name))


def _columns(rows: Any) -> FloatArray:
    """Rows, (n_rows,) or (n_rows, n), as a matrix of columns; read some at a time."""
    result = large_matrix(rows.shape[0], rows.shape[1] if rows.ndim == 2 else 1)
    for start in range(0, len(result), _AT_ONCE):
        some = rows[start : start + _AT_ONCE]
        result[start : start + _AT_ONCE] = some.reshape(len(some), -1)
    return result


def _npz(path: Path) -> RawLog:
    check_is_file(path)
    try:
        with zipfile.ZipFile(path) as archive:
            return _from_arrays(path, _members(archive))
    except FileNotFoundError as error:
        raise missing(path) from error
    except _UNREADABLE as error:
        raise ArtifactError(f"{path}: cannot be read as NPZ ({error}).") from error


def _members(archive: zipfile.ZipFile) -> Iterator[tuple[str, FloatArray]]:
    """Arrays of numbers; not by numpy.load, as one may be larger than memory."""
    for info in archive.infolist():
        with archive.open(info) as file:
            version = np.lib.format.read_magic(file)
            if version not in _HEADERS:  # of text in many alphabets
                continue
            shape, by_column, kind = _HEADERS[version](file)
            if kind.kind not in "fiub" or len(shape) not in (1, 2):
                continue
            n_rows, n_columns = (*shape, 1)[:2]
            if n_rows == 0:
                continue
            if n_rows * n_columns * kind.itemsize != info.file_size - file.tell():
                raise ValueError(f"{info.filename} does not hold the {shape} numbers it declares")
            result = large_matrix(n_rows, n_columns)
            # Numbers follow each other row by row, or column by column.
            lines = result.T if by_column else result
            at_once = 1 if by_column else _AT_ONCE
            for start in range(0, len(lines), at_once):
                part = lines[start : start + at_once]
                numbers = np.frombuffer(file.read(part.size * kind.itemsize), kind)
                part[:] = numbers.reshape(part.shape)
            yield info.filename.removesuffix(".npy"), result


def _from_arrays(path: Path, matrices: Iterator[tuple[str, FloatArray]]) -> RawLog:
    columns: dict[str, FloatArray] = {}
    for name, matrix in matrices:
        if matrix.shape[1] == 1:
            columns[name] = matrix[:, 0]
        else:
            columns |= {f"{name}{k + 1}": column for k, column in enumerate(matrix.T)}
    if not columns:
        raise DataError(f"{path}: holds no columns of numbers.")
    return RawLog(str(path), columns, first_line=None)


def _bag(path: Path) -> RawLog:
    """Fields of all messages as TOPIC/field, of joint states as TOPIC/position/JOINT; TOPIC/time."""
    # Late: an extra, of use to those who have bags.
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise ArtifactError(
            f"{path}: ROS bags are read by rosbags; install it with `pip install 'paramreduce[rosbag]'`."
        ) from error
    if not path.exists():
        raise missing(path)
    if not path.is_dir():
        check_is_file(path)
    found: dict[str, array.array] = {}
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
            for connection, stamp, raw in reader.messages():
                message = reader.deserialize(raw, connection.msgtype)
                row = {"time": _stamp(message, stamp)} | dict(_fields(message))
                for name, value in row.items():
                    found.setdefault(f"{connection.topic}/{name}", array.array("d")).append(value)
    except (AnyReaderError, OSError, ValueError, KeyError, TypeError) as error:
        raise ArtifactError(f"{path}: cannot be read as a ROS 2 bag ({error}).") from error
    if not found:
        raise DataError(f"{path}: holds no messages with numbers.")
    start = min(min(values) for name, values in found.items() if name.endswith("/time"))
    columns = {
        name: np.frombuffer(values) - start if name.endswith("/time") else np.frombuffer(values)
        for name, values in found.items()
    }
    return RawLog(str(path), columns, first_line=None)


def _stamp(message: Any, received: int) -> float:
    """Seconds: the message's own time, or that at which it was received."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    own = 0.0 if stamp is None else stamp.sec + 1e-9 * stamp.nanosec
    return own or 1e-9 * received


_JOINT_STATE = ("position", "velocity", "effort")


def _fields(message: Any, prefix: str = "") -> Iterator[tuple[str, float]]:
    names = getattr(message, "name", None)
    if isinstance(names, list) and all(hasattr(message, key) for key in _JOINT_STATE):
        for key in _JOINT_STATE:
            values = getattr(message, key)
            if len(values) == len(names):
                yield from zip(
                    (f"{prefix}{key}/{name}" for name in names), map(float, values), strict=True
                )
        return
    for key, value in vars(message).items() if hasattr(message, "__dict__") else ():
        if key.startswith("__") or key == "header":
            continue
        if isinstance(value, bool | int | float | np.number):
            yield f"{prefix}{key}", float(value)
        elif isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in "fiu":
            yield from ((f"{prefix}{key}/{k + 1}", float(v)) for k, v in enumerate(value))
        elif hasattr(value, "__dict__") or hasattr(value, "__msgtype__"):
            yield from _fields(value, f"{prefix}{key}/")
