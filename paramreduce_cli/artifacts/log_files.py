"""Logs as people have them: CSV, HDF5, NPZ and ROS 2 bags, all as columns by name."""

import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from paramreduce_cli.artifacts.atomic import check_is_file, missing
from paramreduce_cli.artifacts.csv_files import read_csv
from paramreduce_cli.artifacts.hdf5 import reading
from paramreduce_cli.errors import ArtifactError, DataError
from paramreduce_cli.records import FloatArray, RawLog

_BAGS = (".db3", ".mcap")
_HDF5 = (".h5", ".hdf5")


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
            return _from_arrays(path, ((name, reader.array(name)) for name in numeric))
    if path.suffix == ".npz":
        return _npz(path)
    header, table = read_csv(path, leave_out_text=True)
    columns = {name: np.ascontiguousarray(table[:, k]) for k, name in enumerate(header)}
    return RawLog(str(path), columns, first_line=2)


def _is_numeric(item: Any) -> bool:
    kind = getattr(getattr(item, "dtype", None), "kind", "")
    return kind != "" and kind in "fiub" and item.ndim in (1, 2)


def _npz(path: Path) -> RawLog:
    check_is_file(path)
    try:
        with np.load(path, allow_pickle=False) as arrays:
            return _from_arrays(path, _readable(arrays))
    except FileNotFoundError as error:
        raise missing(path) from error
    except (OSError, EOFError, ValueError, TypeError, zipfile.BadZipFile, zlib.error) as error:
        raise ArtifactError(f"{path}: cannot be read as NPZ ({error}).") from error


def _readable(arrays: Any) -> Iterator[tuple[str, np.ndarray]]:
    """Arrays of a file but those of Python objects."""
    for name in arrays.files:
        try:
            yield name, arrays[name]
        except ValueError:  # objects, which are not read from files of others
            continue


def _from_arrays(path: Path, arrays: Iterator[tuple[str, np.ndarray]]) -> RawLog:
    columns: dict[str, FloatArray] = {}
    for name, array in arrays:
        if array.dtype.kind not in "fiub" or array.ndim not in (1, 2):
            continue
        if array.ndim == 1 or array.shape[1] == 1:
            columns[name] = array.astype(float).ravel()
        else:
            columns |= {f"{name}{k + 1}": array[:, k].astype(float) for k in range(array.shape[1])}
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
    found: dict[str, list[float]] = {}
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
            for connection, stamp, raw in reader.messages():
                message = reader.deserialize(raw, connection.msgtype)
                row = {"time": _stamp(message, stamp)} | dict(_fields(message))
                for name, value in row.items():
                    found.setdefault(f"{connection.topic}/{name}", []).append(value)
    except (AnyReaderError, OSError, ValueError, KeyError, TypeError) as error:
        raise ArtifactError(f"{path}: cannot be read as a ROS 2 bag ({error}).") from error
    if not found:
        raise DataError(f"{path}: holds no messages with numbers.")
    start = min(min(values) for name, values in found.items() if name.endswith("/time"))
    columns = {
        name: np.array(values) - (start if name.endswith("/time") else 0.0)
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
