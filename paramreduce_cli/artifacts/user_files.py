"""User-supplied files: Fourier coefficients, and recorded states and torques."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from paramreduce_cli.artifacts.atomic import make_missing_error
from paramreduce_cli.artifacts.csv_files import read_csv
from paramreduce_cli.artifacts.hdf5 import Reader, open_reader
from paramreduce_cli.errors import DataError
from paramreduce_cli.records import SETS, Coefficients, FloatArray, Recording, SignalTable

_HDF5 = (".h5", ".hdf5")
_FEWEST_SAMPLES = 10


def load_coefficients(path: Path) -> Coefficients:
    """Read Fourier coefficients.

    The file is HDF5 in the layout of trajectories.h5, or JSON in that of summary.json.

    Raises:
        DataError: The file holds no coefficients, or they are not all finite.
        ArtifactError: The file cannot be read.
    """
    if path.suffix in _HDF5:
        with open_reader(path) as reader:
            period = reader.read_attribute("period")
            sets = {
                name: reader.read_array(f"{name}/coefficients", 3)
                for name in SETS
                if f"{name}/coefficients" in reader or name != "test"
            }
    else:
        period, sets = _read_json_coefficients(path)
    if not isinstance(period, int | float) or not 0 < period < math.inf:
        raise DataError(f"{path}: the period must be a positive number of seconds.")
    if "test" not in sets or not sets["test"].size:
        sets["test"] = sets["validation"][:0]
    for name, values in sets.items():
        if name == "test" and not len(values):
            continue
        if values.ndim != 3 or 0 in values.shape or not np.isfinite(values).all():
            raise DataError(
                f"{path}: the {name} coefficients must be finite numbers of shape (n_traj, n_dof, "
                f"1 + 2 harmonics), not {values.shape}."
            )
        if values.shape[2] % 2 == 0:
            raise DataError(
                f"{path}: the {name} coefficients have {values.shape[2]} numbers per joint; [q0, "
                "a1, b1, a2, b2, ...] is an odd count."
            )
    return Coefficients(str(path), float(period), **sets)


def _read_json_coefficients(path: Path) -> tuple[Any, dict[str, FloatArray]]:
    """Return the period and the coefficients by set in a JSON file.

    Raises:
        DataError: The file holds no Fourier coefficients.
        ArtifactError: The file is missing.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        trajectories = data["trajectories"]
        sets = {
            name: np.array([entry["coefficients"] for entry in trajectories[name]], dtype=float)
            for name in SETS
            if name in trajectories or name != "test"
        }
        return trajectories["period"], sets
    except FileNotFoundError as error:
        raise make_missing_error(path) from error
    except (OSError, UnicodeDecodeError, ValueError, KeyError, TypeError) as error:
        raise DataError(
            f"{path}: holds no Fourier coefficients ({type(error).__name__}: {error}). Bring a "
            'trajectories.h5, or JSON such as {"trajectories": {"period": 6.28, "estimation": '
            '[{"coefficients": [[q0, a1, b1], ...]}], "validation": [...]}}.'
        ) from error


def load_recording(path: Path, n_dof: int) -> Recording:
    """Read states, and torques if there are any.

    CSV (also gzipped) with a header: ``t`` or ``time``, ``z1 ... zn``, ``dz1 ...``,
    ``ddz1 ...``, and perhaps ``tau1 ...``. HDF5 with datasets ``z dz ddz`` and perhaps
    ``time tau``, each (n_samples, n_dof).

    Raises:
        DataError: Columns are missing, there are too few rows, or numbers are not finite.
        ArtifactError: The file cannot be read.
    """
    if path.suffix in _HDF5:
        with open_reader(path) as reader:
            arrays = _read_hdf5_arrays(reader)
    else:
        arrays = _read_csv_arrays(path, n_dof)
    for key in ("z", "dz", "ddz"):
        if arrays.get(key) is None or arrays[key].ndim != 2:
            raise DataError(
                f"{path}: {key} is missing or no matrix; states are z, dz and ddz of every joint."
            )
    rows = arrays["z"].shape[0]
    for key, value in arrays.items():
        expected = (rows,) if key == "time" else (rows, n_dof)
        if value.shape != expected:
            raise DataError(
                f"{path}: {key} has shape {value.shape}, but the robot has {n_dof} joints and there "
                f"are {rows} rows: it must be {expected}."
            )
        known = np.isfinite(value) | (np.isnan(value) & (key == "tau"))  # some may be unmeasured
        if not known.all():
            bad = int(np.argwhere(~known)[0, 0])
            raise DataError(
                f"{path}: {key} is not a finite number in data row {bad + 1}. Remove such rows."
            )
    if rows < _FEWEST_SAMPLES:
        raise DataError(f"{path}: {rows} samples are too few; use at least {_FEWEST_SAMPLES}.")
    time = arrays.get("time", np.arange(rows, dtype=float))
    _check_time(path, time.ravel())
    return Recording(
        str(path), time.ravel(), arrays["z"], arrays["dz"], arrays["ddz"], arrays.get("tau")
    )


def load_signals(path: Path) -> SignalTable:
    """Read a table whose first column holds ascending times or distances, and the others signals.

    Raises:
        DataError: The table has one column or row, or the first column does not ascend.
        ArtifactError: The file cannot be read.
    """
    table = read_csv(path)
    numbers = table.numbers
    if numbers.shape[0] < _FEWEST_SAMPLES or numbers.shape[1] < 2:
        raise DataError(
            f"{path}: a signal needs a column of times or distances, columns of values, and at least "
            f"{_FEWEST_SAMPLES} rows; there are {numbers.shape[1]} columns and {numbers.shape[0]} rows."
        )
    bad = np.flatnonzero(~np.isfinite(numbers).all(axis=1))
    if bad.size:
        raise DataError(
            f"{path}: data row {bad[0] + 1} has a number that is not finite. Remove such rows."
        )
    steps = np.diff(numbers[:, 0])
    if not np.all(steps > 0):
        row = int(np.argmin(steps)) + 2
        raise DataError(
            f"{path}: {table.header[0]} does not rise in data row {row}. Sort the rows, or remove repeated ones."
        )
    return SignalTable(str(path), numbers[:, 0], numbers[:, 1:])


def _check_time(path: Path, time: FloatArray) -> None:
    """Raise DataError unless time rises; it may start again where another trajectory begins."""
    steps = np.diff(time)
    starts = np.concatenate([[-1], np.flatnonzero(steps < 0), [time.size - 1]])
    wrong = np.flatnonzero(steps == 0)
    if wrong.size == 0 and np.diff(starts).min() < _FEWEST_SAMPLES:
        wrong = np.flatnonzero(steps < 0)
    if wrong.size:
        row = int(wrong[0]) + 1
        raise DataError(
            f"{path}: the time does not go on from data row {row} to {row + 1}. Give it in seconds, "
            "rising; it may begin anew where another trajectory does."
        )


def _read_hdf5_arrays(reader: Reader) -> dict[str, FloatArray]:
    """Return the states, torques and times that the file holds."""
    names = ("z", "dz", "ddz", "tau", "time")
    return {name: reader.read_array(name).astype(float) for name in names if name in reader}


def _read_csv_arrays(path: Path, n_dof: int) -> dict[str, FloatArray]:
    """Return the arrays of states and torques in a CSV file.

    Raises:
        DataError: A column is missing, or there are columns of more joints than the robot has.
    """
    header, data, *_ = read_csv(path)
    columns = {name: data[:, k] for k, name in enumerate(header)}
    arrays: dict[str, FloatArray] = {}
    for key in ("z", "dz", "ddz", "tau"):
        if f"{key}{n_dof + 1}" in columns:
            raise DataError(
                f"{path}, line 1: there is a column {key}{n_dof + 1}, but the robot has {n_dof} joints."
            )
        names = [f"{key}{j + 1}" for j in range(n_dof)]
        some = key == "tau" and any(name in columns for name in names)
        if some or all(name in columns for name in names):
            unknown = np.full(len(data), np.nan)
            arrays[key] = np.column_stack([columns.get(name, unknown) for name in names])
        elif key != "tau":
            missing = [name for name in names if name not in columns]
            raise DataError(
                f"{path}, line 1: the header lacks {', '.join(missing)}. Columns are t, z1 ... "
                f"z{n_dof}, dz1 ..., ddz1 ..., and optionally tau1 ...; the file has {', '.join(header)}."
            )
    for name in ("t", "time"):
        if name in columns:
            arrays["time"] = columns[name]
    return arrays
