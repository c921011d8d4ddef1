"""Log files of users: CSV, HDF5, NPZ and ROS 2 bags, all read as columns by name."""

import array
import lzma
import tokenize
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from paramreduce_cli.artifacts.atomic import check_is_file, make_missing_error
from paramreduce_cli.artifacts.csv_files import read_csv
from paramreduce_cli.artifacts.hdf5 import open_reader
from paramreduce_cli.errors import ArtifactError, DataError
from paramreduce_cli.records import FloatArray, RawLog
from paramreduce_cli.resources.scratch import allocate_matrix

_MOST_COLUMNS = 64
"""Columns of a matrix beyond which they are samples, where rows are fewer."""
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
        ArtifactError: The file cannot be read.
        DataError: The log holds no columns of numbers.
    """
    if path.is_dir() or path.suffix in _BAGS:
        return _load_bag(path)
    if path.suffix in _HDF5:
        with open_reader(path) as reader:
            names: list[str] = []
            reader.file.visit(names.append)
            kinds = {name: _classify_dataset(reader.file[name]) for name in names}
            numeric = [name for name, kind in kinds.items() if kind == _NUMBERS]
            others = {name: kind for name, kind in kinds.items() if kind not in ("", _NUMBERS)}
            return _split_columns(
                path, ((name, _read_columns(reader.open_rows(name))) for name in numeric), others
            )
    if path.suffix == ".npz":
        return _load_npz(path)
    table = read_csv(path, leave_out_text=True)
    columns = dict(zip(table.header, table.numbers.T, strict=True))
    return RawLog(str(path), columns, first_line=2, others=dict.fromkeys(table.left_out, "text"))


_NUMBERS = "numbers"
_KINDS = {"c": "complex numbers", "b": "true and false", "S": "text", "U": "text", "O": "text"}
"""What arrays hold by NumPy's kind of their type, where it is no real number."""


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


def _load_npz(path: Path) -> RawLog:
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


def _load_bag(path: Path) -> RawLog:
    """Return the fields of all messages of a bag as TOPIC/field, of joint states as TOPIC/position/JOINT, with
    TOPIC/time.

    Raises:
        DataError: No message has numbers.
        ArtifactError: The bag is missing or unreadable, or rosbags is not installed.
    """
    # Late: an extra, of use to those who have bags.
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise ArtifactError(
            f"{path}: ROS bags are read by rosbags.",
            remedy="Install it with `pip install 'paramreduce[rosbag]'`.",
        ) from error
    if not path.exists():
        raise make_missing_error(path)
    if not path.is_dir():
        check_is_file(path)
    found: dict[tuple[str, str], tuple[array.array, array.array]] = {}
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
            for connection, stamp, raw in reader.messages():
                message = reader.deserialize(raw, connection.msgtype)
                time = _get_time(message, stamp)
                for name, value in _iterate_fields(message):
                    column = found.setdefault(
                        (connection.topic, name), (array.array("d"), array.array("d"))
                    )
                    column[0].append(time)
                    column[1].append(value)
    except (AnyReaderError, OSError, ValueError, KeyError, TypeError) as error:
        raise ArtifactError(f"{path}: cannot be read as a ROS 2 bag ({error}).") from error
    if not found:
        raise DataError(f"{path}: holds no messages with numbers.")
    start = min(min(times) for times, _ in found.values())
    columns: dict[str, FloatArray] = {}
    for topic in dict.fromkeys(topic for topic, _ in found):
        fields = {name: columns for (own, name), columns in found.items() if own == topic}
        columns |= _name_columns(topic, fields, start)
    return RawLog(str(path), columns, first_line=None)


def _name_columns(
    topic: str, fields: Mapping[str, tuple[array.array, array.array]], start: float
) -> dict[str, FloatArray]:
    """Name the columns of a topic, and their times: TOPIC/time of most columns, of others TOPIC/time_of/FIELD.

    Several nodes may publish some joints each under one topic, so each column has the times of the messages that
    contain it.

    Args:
        topic: Name of the topic.
        fields: Times and values by name of the field.
        start: Time of the first message of the recording, s.
    """
    groups: dict[bytes, list[str]] = {}
    for name, (times, _) in fields.items():
        groups.setdefault(times.tobytes(), []).append(name)
    columns: dict[str, FloatArray] = {}
    for k, names in enumerate(sorted(groups.values(), key=len, reverse=True)):
        key = f"{topic}/time" if k == 0 else f"{topic}/time_of/{names[0]}"
        columns[key] = np.frombuffer(fields[names[0]][0]) - start
        columns |= {f"{topic}/{name}": np.frombuffer(fields[name][1]) for name in names}
    return columns


def _get_time(message: Any, received: int) -> float:
    """Return the time of a message, s: its own, or the time at which it was received."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    own = 0.0 if stamp is None else stamp.sec + 1e-9 * stamp.nanosec
    return own or 1e-9 * received


_JOINT_STATE = ("position", "velocity", "effort")


def _iterate_fields(message: Any, prefix: str = "") -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message with their names."""
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
            yield from _iterate_fields(value, f"{prefix}{key}/")
