"""ROS bags, read as columns by name."""

import array
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from paramreduce_cli.artifacts.atomic import check_is_file, make_missing_error
from paramreduce_cli.errors import ArtifactError, DataError
from paramreduce_cli.records import FloatArray, RawLog


def load_bag(path: Path) -> RawLog:
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
        raise ArtifactError(f"{path}: cannot be read as a ROS bag ({error}).") from error
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
    """Name the columns of a topic, and their times: TOPIC/time of most columns, TOPIC/time_of/FIELD of each other one.

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
        keys = [f"{topic}/time"] if k == 0 else [f"{topic}/time_of/{name}" for name in names]
        columns |= dict.fromkeys(keys, np.frombuffer(fields[names[0]][0]) - start)
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
