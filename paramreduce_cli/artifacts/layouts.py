"""Layouts of artifacts: every record is written and read field by field.

A field is a dataset of its name, a record in a field a group. What is called otherwise in a file
is listed here; docs/artifacts.md describes the same for people, with shapes and units.
"""

import dataclasses
import json
import types
import typing
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from paramreduce_cli.artifacts.hdf5 import Reader, StoredRows, Writer
from paramreduce_cli.artifacts.plain_data import from_plain, get_dtype, to_plain
from paramreduce_cli.records import (
    Columns,
    HeuristicValidation,
    MeasuredLog,
    MeasuredMotions,
    Model,
    Proofs,
    ReducedModel,
    Reduction,
    Selected,
    Stability,
    Subsets,
    TermFront,
    TermModel,
    Trajectories,
    Trajectory,
    Validation,
)

_NAMES: dict[tuple[type, str], str] = {
    (Model, "values"): "parameters/values",
    (Model, "affecting"): "parameters/affecting",
    (Trajectory, "kappa"): "condition_number",
    (Trajectory, "kappa_variants"): "condition_number_variants",
    (Reduction, "columns"): "parameters",
    **{
        (record, f"{quantity}_error"): f"{quantity}_error_"
        for record in (HeuristicValidation, TermModel, TermFront)
        for quantity in ("torque", "acceleration")
    },
    (HeuristicValidation, "joint_torque_error"): "torque_error_joint_",
    (HeuristicValidation, "joint_acceleration_error"): "acceleration_error_joint_",
    (HeuristicValidation, "mass_matrix"): "mass_matrix_",
    (HeuristicValidation, "operations"): "operations_",
    (MeasuredLog, "warnings"): "doubts",
    (Validation, "warnings"): "remarks",
    (Selected, "model"): "",
    (Stability, "variants"): "",
    (ReducedModel, "names"): "parameters",
}
"""Fields whose datasets have another name. A group without a name is that of the record itself; one whose name ends
with an underscore is no group, but the beginning of its datasets' names."""
_ATTRIBUTES = {
    (Trajectories, name)
    for name in (
        "period",
        "points",
        "criterion",
        "scaling",
        "use_full_range",
        "rest_to_rest",
        "source",
    )
}
"""Fields that are attributes of the file."""
_TEXTS = {(Model, "mechanism"), (Model, "formulations"), (Trajectories, "constraints")}
"""Fields that are one JSON text."""
_BY_SIZE = {
    *((Subsets, name) for name in ("subsets", "parameters")),
    *((Proofs, name) for name in ("subsets", "logs")),
}
"""Arrays, one for each subset: datasets named by its size."""
_BY_ROWS, _LARGE = {MeasuredMotions}, 1 << 22
"""Records whose arrays are not loaded, but read by rows, from so many bytes on."""
_TIMINGS = {"seconds", "cpu_seconds", "nodes"}
"""How long something took, which is no part of what a file holds; nodes depend on the number of threads."""
_KEYS: dict[tuple[type, str], str] = {(Trajectory, "kappa_variants"): "scalings"}
"""What the list of the names in a mapping is called."""
_DERIVED: dict[type, Callable[[Any], dict[str, Any]]] = {
    Model: lambda model: {
        "parameters/names": model.mechanism.parameter_names,
        "coordinates/names": model.mechanism.coordinate_names,
        "coordinates/generalised": model.mechanism.generalised_names,
    },
    Selected: lambda selected: {"n": selected.n},
    Stability: lambda found: {"variants": [str(variant) for variant in found.variants]},
    Columns: lambda columns: {"expansion": columns.expansion},
    Subsets: lambda found: {} if found.order is None else {"order": found.order},
}
"""Datasets that follow from a record, for readers of the file."""


def _iterate_fields(record: type, prefix: str) -> Iterator[tuple[str, Any, str]]:
    """Yield name, type and path of every field."""
    hints = typing.get_type_hints(record)
    for field in dataclasses.fields(record):
        path = _join_path(prefix, _NAMES.get((record, field.name), field.name))
        yield field.name, hints[field.name], path


def _join_path(prefix: str, name: str) -> str:
    """Return the path of a name below a prefix."""
    if prefix.endswith("_"):
        return prefix + name
    return "/".join(part for part in (prefix, name) if part)


def save(writer: Writer, record: Any, prefix: str = "") -> None:
    """Write a record."""
    kind = type(record)
    for name, hint, path in _iterate_fields(kind, prefix):
        value = getattr(record, name)
        if (kind, name) in _TEXTS:
            writer.write_dataset(path, json.dumps(to_plain(value), allow_nan=False))
        elif (kind, name) in _ATTRIBUTES:
            writer.write_attribute(name, value)
        elif (kind, name) in _BY_SIZE:
            for n, array in zip(record.n, value, strict=True):
                writer.write_dataset(f"{path}/{n}", array)
        elif name in _TIMINGS:
            writer.write_timing(path, value)
        elif value is not None:
            _save_value(writer, hint, value, path)
    if kind in _DERIVED:
        for name, value in _DERIVED[kind](record).items():
            writer.write_dataset(_join_path(prefix, name), value)


def _save_value(writer: Writer, hint: Any, value: Any, path: str) -> None:
    """Write the value of a field, as its type asks."""
    entry = _get_entry_type(hint)
    if dataclasses.is_dataclass(value):
        save(writer, value, path)
    elif isinstance(value, Mapping) and dataclasses.is_dataclass(entry):
        names, group = _name_listing(path)
        writer.write_dataset(names, np.array(list(value), dtype=str))
        for name, record in value.items():
            save(writer, record, _join_path(group, name))
    elif isinstance(value, Mapping):
        writer.write_dataset(f"{path}/names", np.array(list(value), dtype=str))
        writer.write_dataset(f"{path}/values", np.array(list(value.values()), dtype=float))
    elif dataclasses.is_dataclass(entry):
        save_table(writer, typing.cast(type, entry), value, path)
    elif isinstance(value, tuple) and typing.get_origin(entry) is np.ndarray:
        writer.write_dataset(
            f"{path}/columns", np.concatenate([np.zeros(0, get_dtype(entry)), *value])
        )
        writer.write_dataset(
            f"{path}/sizes", np.array([array.size for array in value], dtype=np.int64)
        )
    elif isinstance(value, tuple):
        writer.write_dataset(path, np.array(value, dtype=str))
    else:
        writer.write_dataset(path, value)


_AT_THE_TOP = "heuristics"
"""A mapping whose records stand at the top of the file."""


def _name_listing(path: str) -> tuple[str, str]:
    """Return the dataset with the names of a mapping's records, and the group of the records."""
    return (path, "") if path == _AT_THE_TOP else (f"{path}/names", path)


def save_table(writer: Writer, record: type, rows: tuple[Any, ...], path: str) -> None:
    """Write records of one kind, a field of all of them together."""
    for name, hint, where in _iterate_fields(record, path):
        values = [getattr(row, name) for row in rows]
        if typing.get_origin(hint) is Mapping:
            keys = list(values[0]) if values else []
            listed = _join_path(path, _KEYS[record, name])
            writer.write_dataset(listed, np.array(keys, dtype=str))
            for key in keys:
                writer.write_dataset(f"{where}/{key}", np.array([value[key] for value in values]))
        elif name in _TIMINGS:
            writer.write_timing(where, values)
        else:
            kind = str if isinstance(hint, type) and issubclass(hint, str) else None
            writer.write_dataset(where, np.array(values, dtype=kind))


def load(reader: Reader, record: type, prefix: str = "") -> Any:
    """Read what :func:`save` wrote."""
    values: dict[str, Any] = {}
    for name, hint, path in _iterate_fields(record, prefix):
        if (record, name) in _TEXTS:
            values[name] = from_plain(hint, json.loads(reader.read_text(path)))
        elif (record, name) in _ATTRIBUTES:
            values[name] = hint(reader.read_attribute(name))
        elif (record, name) in _BY_SIZE:
            arrays = (reader.read_array(f"{path}/{n}") for n in values["n"])
            values[name] = tuple(arrays)
        elif record in _BY_ROWS and reader.open_rows(path).nbytes > _LARGE:
            values[name] = StoredRows(reader, path)
        else:
            values[name] = _load_value(reader, hint, path)
    return record(**values)


def _load_value(reader: Reader, hint: Any, path: str) -> Any:
    """Return the value of a field, read as its type asks."""
    origin, entry = typing.get_origin(hint), _get_entry_type(hint)
    if origin in (typing.Union, types.UnionType):
        (inner,) = (a for a in typing.get_args(hint) if a is not type(None))
        return _load_value(reader, inner, path) if path in reader else None
    if dataclasses.is_dataclass(hint):
        return load(reader, typing.cast(type, hint), path)
    if origin is np.ndarray:
        return reader.read_array(path).astype(get_dtype(hint), copy=False)
    if origin is Mapping and dataclasses.is_dataclass(entry):
        record = typing.cast(type, entry)
        names, group = _name_listing(path)
        return {
            name: load(reader, record, _join_path(group, name)) for name in reader.read_texts(names)
        }
    if origin is Mapping:
        numbers = reader.read_array(f"{path}/values", 1).tolist()
        return dict(zip(reader.read_texts(f"{path}/names"), numbers, strict=True))
    if dataclasses.is_dataclass(entry):
        return load_table(reader, typing.cast(type, entry), path)
    if typing.get_origin(entry) is np.ndarray:
        ends = np.cumsum(reader.read_array(f"{path}/sizes", 1))[:-1]
        return tuple(np.split(reader.read_array(f"{path}/columns", 1), ends))
    if origin is tuple:
        return tuple(entry(text) for text in reader.read_texts(path))
    if issubclass(hint, str):
        return hint(reader.read_text(path))
    return hint(reader.read_array(path).item())


def load_table(reader: Reader, record: type, path: str) -> tuple[Any, ...]:
    """Read what :func:`save_table` wrote."""
    columns: dict[str, list[Any]] = {}
    for name, hint, where in _iterate_fields(record, path):
        if typing.get_origin(hint) is Mapping:
            keys = reader.read_texts(_join_path(path, _KEYS[record, name]))
            series = (reader.read_array(f"{where}/{key}", 1).tolist() for key in keys)
            columns[name] = [dict(zip(keys, row, strict=True)) for row in zip(*series, strict=True)]
        elif typing.get_origin(hint) is np.ndarray:
            columns[name] = list(reader.read_array(where))
        elif issubclass(hint, str):
            columns[name] = [hint(text) for text in reader.read_texts(where)]
        else:
            columns[name] = [hint(value) for value in reader.read_array(where, 1)]
    rows = zip(*columns.values(), strict=True)
    return tuple(record(**dict(zip(columns, row, strict=True))) for row in rows)


def _get_entry_type(hint: Any) -> Any:
    """Return the type of the entries of a tuple or of the values of a mapping, also of an optional one; None for other
    types.
    """
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        return _get_entry_type(next(a for a in arguments if a is not type(None)))
    if origin is Mapping:
        return arguments[1]
    return arguments[0] if origin is tuple else None
