"""Signals of a robot's joints in SI units at an even rate, from recorded columns."""

import itertools
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # its interpolate takes a quarter of a second to load, so only when it is used

from paramreduce_cli.config.log_settings import (
    ACCELERATIONS,
    ANGLES,
    NUMBER,
    SPEEDS,
    TIMES,
    TORQUES,
    LogSection,
    Names,
)
from paramreduce_cli.errors import ConfigError, DataError
from paramreduce_cli.fields.section import expand_per_joint
from paramreduce_cli.identification import filters
from paramreduce_cli.identification.encoder_wraps import unwrap_positions
from paramreduce_cli.identification.log_joining import GAP, align_column
from paramreduce_cli.records import BoolArray, FloatArray, RawLog
from paramreduce_cli.resources.scratch import allocate_matrix, stack_columns

_EVEN = 0.005
"""Deviation of a time step from the usual one, a share, up to which time is even."""
_FEWEST = 50
"""Samples of an uninterrupted motion that is used."""
_AT_ONCE = 10_000
"""Rows."""
_LARGEST = 1e30
"""More than any signal in any unit, nanoseconds since 1970 included; powers of it can be computed with."""
_MOST_SHOWN = 12
"""Names of columns in a message."""


@dataclass(frozen=True)
class Signals:
    """A recording of uninterrupted motion, in SI units of the joints; each array (n_samples, n_dof)."""

    time: FloatArray
    """(n_samples,)"""
    z: FloatArray
    dz: FloatArray | None
    ddz: FloatArray | None
    tau: FloatArray
    turns: tuple[int, ...] = ()
    """Number of whole turns that were added to each position, empty where not known, (n_dof,)."""

    def slice_rows(self, rows: slice | BoolArray) -> "Signals":
        """Return the signals at some samples."""
        dz = None if self.dz is None else self.dz[rows]
        ddz = None if self.ddz is None else self.ddz[rows]
        return Signals(self.time[rows], self.z[rows], dz, ddz, self.tau[rows], self.turns)

    def get_joint(self, j: int) -> "Signals":
        """Return the signals of one joint, (n_samples, 1) each."""
        dz = None if self.dz is None else self.dz[:, j : j + 1]
        ddz = None if self.ddz is None else self.ddz[:, j : j + 1]
        return Signals(self.time, self.z[:, j : j + 1], dz, ddz, self.tau[:, j : j + 1])


def read_signals(
    log: RawLog, section: LogSection, names: Sequence[str], unmeasured: Collection[str] = ()
) -> Signals:
    """Return the signals of a file, row by row.

    Args:
        log: Log file.
        section: Settings of the columns.
        names: Names of the coordinates.
        unmeasured: Joints without torques, whose torques are set to zero.

    Raises:
        DataError: Columns are missing, or hold what cannot be; file, line and column are named.
        ConfigError: Signs, gears and the like do not fit the robot.
    """
    columns, units = section.columns, section.units
    recorded_rate = section.recorded_rate
    time = None
    if recorded_rate is None:
        time = _read_column(log, columns.time) * TIMES[units.time]

    def read_quantity(key: str, factor: float) -> FloatArray | None:
        """Return the columns of a quantity in SI units, or None if the log lacks them."""
        where = getattr(columns, key)
        if where is None:
            return None
        left_out = unmeasured if key == "torque" else ()
        rows = None if time is None else (columns.time, time.size)
        values = _read_matrix(log, where, names, key, rows, left_out)
        values *= factor
        return values

    position, velocity = ANGLES[units.position], SPEEDS[units.velocity]
    z, dz = read_quantity("position", position), read_quantity("velocity", velocity)
    ddz = read_quantity("acceleration", ACCELERATIONS[units.acceleration])
    tau = read_quantity("torque", TORQUES[units.torque])
    assert z is not None
    assert tau is not None
    if time is None:
        time = np.arange(len(z)) / (recorded_rate or 1.0)
    _check_time(log, columns.time, time)
    kept = np.all(
        [np.isfinite(part).all(axis=1) for part in (z, dz, ddz) if part is not None], axis=0
    )
    if not kept.all():  # other topics begin later or have gaps
        if np.count_nonzero(kept) < _FEWEST:
            raise DataError(
                f"{log.source}: positions, speeds and {columns.time} have hardly any time in common."
            )
        time, z, tau = time[kept], z[kept], tau[kept]
        dz, ddz = (None if part is None else part[kept] for part in (dz, ddz))
    turns = unwrap_positions(z) if section.outliers == "replace" else ()
    return _convert_to_joints(Signals(time, z, dz, ddz, tau, turns), section, len(names))


def _convert_to_joints(signals: Signals, section: LogSection, n_dof: int) -> Signals:
    """Convert signals of motors to signals of joints, in place, as there may be gigabytes.

    Raises:
        ConfigError: The transmission matrix cannot be inverted or has another size, or there are not as many signs,
            torque constants or offsets as joints.
    """
    sign = _expand_per_joint(section.apart.motion, "signs", n_dof)
    tau = signals.tau
    tau *= _expand_per_joint(section.apart.torque, "signs", n_dof)
    if section.torque_constants is not None:
        tau *= _expand_per_joint(section.torque_constants, "torque_constants", n_dof)
    motion = [signals.z, signals.dz, signals.ddz]
    for values in motion:
        if values is not None:
            values *= sign
    try:
        gears = section.compute_motor_matrix(n_dof)
    except ValueError as error:
        raise ConfigError(str(error), ("sampling", "log", "transmission")) from error
    if gears is not None:
        inverse = np.asarray(np.linalg.inv(gears), dtype=np.float64)
        for values in motion:
            if values is not None:
                _multiply_in_place(values, inverse.T)
        _multiply_in_place(tau, gears)
    z, dz, ddz = motion
    assert z is not None
    z += _expand_per_joint(section.offsets, "offsets", n_dof)
    return Signals(signals.time, z, dz, ddz, tau, signals.turns)


def _multiply_in_place(values: FloatArray, factors: FloatArray) -> None:
    """Multiply values by factors, in place."""
    for start in range(0, len(values), _AT_ONCE):
        values[start : start + _AT_ONCE] = values[start : start + _AT_ONCE] @ factors


def _expand_per_joint(values: list[float], key: str, n_dof: int) -> FloatArray:
    """Return a value for each joint; raise ConfigError for another number of values."""
    if len(values) not in (1, n_dof):
        raise ConfigError(
            f"has {len(values)} values for {n_dof} joints. Give one for each, or one for all.",
            ("sampling", "log", key),
        )
    return expand_per_joint(values, n_dof)


def _read_matrix(
    log: RawLog,
    names: Names,
    joints: Sequence[str],
    key: str,
    rows: tuple[str, int] | None,
    left_out: Collection[str],
) -> FloatArray:
    """Return the columns of a quantity, (n_rows, n_dof); columns of joints that are left out are zero.

    Args:
        log: Log as read.
        names: Names of the columns, or a pattern with ``{}`` for the number or ``{name}`` for the name of the joint.
        joints: Names of the joints.
        key: Key of the quantity under sampling.log.columns, for messages.
        rows: Name of the column of times and its number of rows, which the other columns must have; None without times.
        left_out: Joints without measurements, which need no column.

    Raises:
        ConfigError: The list of names is of another number of joints.
        DataError: A column is missing, unusable, or of another length, or there are columns of more joints.
    """
    n_dof = len(joints)
    if isinstance(names, str):
        if NUMBER in names and names.replace(NUMBER, str(n_dof + 1)) in log.columns:
            raise DataError(
                f"{log.source}: there is a column {names.replace(NUMBER, str(n_dof + 1))}, but the robot "
                f"has {n_dof} joints. Is the log of another robot? If not, name its columns one by one "
                f"under sampling.log.columns.{key}."
            )
        listed = [
            names.replace(NUMBER, str(j + 1)).replace("{name}", joint)
            for j, joint in enumerate(joints)
        ]
    else:
        given = iter(names)
        alone = len(names) == n_dof - len(left_out)  # a list may be of the measured ones
        listed = ["" if alone and joint in left_out else next(given, "") for joint in joints]
        if len(names) != n_dof and not alone:
            raise ConfigError(
                f"names {len(names)} columns for {n_dof} joints.",
                ("sampling", "log", "columns", key),
            )
    known = {
        joint: name for joint, name in zip(joints, listed, strict=True) if joint not in left_out
    }
    found = {
        joint: _read_column(log, name, missing=key == "torque", rows=rows)
        for joint, name in known.items()
    }
    if rows is None:
        first = next(iter(log.columns))
        rows = first, log.columns[first].size
    for joint, column in found.items():
        name = known[joint]
        if column.size != rows[1]:
            raise DataError(
                f"{log.source}: column {name} has {column.size} rows, {rows[0]} has {rows[1]}; use signals that were recorded together."
            )
    return stack_columns([found.get(joint, np.zeros(rows[1])) for joint in joints])


def _read_column(
    log: RawLog, name: str, *, missing: bool = False, rows: tuple[str, int] | None = None
) -> FloatArray:
    """Return a column of numbers; with ``missing`` some entries may be no numbers.

    A column of another topic with times of its own is interpolated at the times of the recording; entries outside its own
    times are not numbers.

    Args:
        log: Log as read.
        name: Name of the column.
        missing: Whether some entries may be no numbers.
        rows: Name of the column of times and its number of rows; None without times.

    Raises:
        DataError: The column is missing, too short, or holds entries that are no finite numbers.
    """
    column = log.columns.get(name)
    if column is None and name in log.others:
        raise DataError(f"{log.source}: column {name} holds {log.others[name]}; use numbers.")
    if column is None:
        known = list(log.columns)
        shown = ", ".join(known[:_MOST_SHOWN]) + (", ..." if len(known) > _MOST_SHOWN else "")
        raise DataError(
            f"{log.source}: there is no column {name}. Columns: {shown}. Assign them under sampling.log.columns."
        )
    wrong = np.flatnonzero(~(np.abs(column) < _LARGEST))
    if wrong.size == column.size:
        raise DataError(
            f"{log.source}: column {name} holds no number at all. Leave it out of sampling.log.columns; speeds and "
            "accelerations are then made of the positions."
        )
    if missing:
        wrong = np.flatnonzero(np.abs(column) >= _LARGEST)
    if not wrong.size and rows is not None and rows[0] in log.columns:
        column = align_column(log, name, rows[0])
        if not np.any(np.isfinite(column)):
            raise DataError(
                f"{log.source}: columns {name} and {rows[0]} have no time in common. Were they recorded by other clocks?"
            )
    if wrong.size:
        more = f", nor are {wrong.size - 1} others" if wrong.size > 1 else ""
        raise DataError(
            f"{log.describe_row(int(wrong[0]))}, column {name}: is empty or not a finite number below {_LARGEST:g}{more}. "
            "Remove such rows."
        )
    if column.size < _FEWEST:
        raise DataError(f"{log.source}: {column.size} rows are too few; use {_FEWEST} or more.")
    return column


def _check_time(log: RawLog, name: str, time: FloatArray) -> None:
    """Raise DataError unless time increases from row to row."""
    steps = np.diff(time)
    wrong = np.flatnonzero(steps <= 0)
    if wrong.size:
        row = int(wrong[0]) + 1
        what = "stands still" if steps[row - 1] == 0 else "goes back"
        raise DataError(
            f"{log.describe_row(row)}, column {name}: time {what}, from {time[row - 1]:.6g} s to "
            f"{time[row]:.6g} s; so it does in {wrong.size} rows. Use rows in the order in which they "
            "were recorded, one file for each recording."
        )


def resample_evenly(
    signals: Signals, steps: Collection[int] = ()
) -> tuple[list[Signals], float, list[str]]:
    """Split a recording into uninterrupted motions at an even rate.

    Uneven time is resampled by cubic splines; gaps separate motions.

    Args:
        signals: The recording.
        steps: Rows at which a new motion begins although no time is missing.

    Returns:
        The motions, samples per second, and what was done.

    Raises:
        DataError: Nothing long enough is left.
    """
    step = float(np.median(np.diff(signals.time)))
    gaps = np.flatnonzero(np.diff(signals.time) > GAP * step)
    edges = sorted({0, *(gaps + 1).tolist(), *steps, signals.time.size})
    pieces = [signals.slice_rows(slice(a, b)) for a, b in itertools.pairwise(edges)]
    kept = [piece for piece in pieces if piece.time.size >= _FEWEST]
    if not kept:
        raise DataError(
            f"no motion of {_FEWEST} samples in a row is left between {gaps.size} gaps in time."
        )
    messages = []
    if gaps.size:
        longest = float(np.diff(signals.time).max())
        messages.append(
            f"{gaps.size} gaps in time, the longest of {longest:.3g} s, part the log; {len(kept)} of "
            f"{len(pieces)} pieces are long enough."
        )
    uneven = max(float(np.abs(np.diff(p.time) - step).max()) for p in kept) / step
    if uneven > _EVEN:
        kept = [_resample(piece, step) for piece in kept]
        messages.append(
            f"Time steps differ by up to {100 * uneven:.3g} %; resampled to {1 / step:.6g} Hz by cubic "
            "splines."
        )
    return kept, 1 / step, messages


def change_rate(signals: Signals, rate: float, new_rate: float) -> Signals:
    """Return signals at another rate, low-passed before if it is lower.

    Args:
        signals: Signals at an even rate.
        rate: Samples per second of the signals.
        new_rate: Samples per second of the result.
    """
    taps = filters.design_low_pass(filters.ANTI_ALIAS * new_rate, rate)

    def apply(values: FloatArray | None) -> FloatArray | None:
        return None if values is None else filters.apply_filter(values, taps)

    z, tau = (filters.apply_filter(values, taps) for values in (signals.z, signals.tau))
    low = Signals(signals.time, z, apply(signals.dz), apply(signals.ddz), tau, signals.turns)
    return _resample(low, 1 / new_rate)


def _resample(signals: Signals, step: float) -> Signals:
    """Return signals at an even time step, by cubic splines."""
    time = signals.time[0] + step * np.arange(int((signals.time[-1] - signals.time[0]) / step) + 1)

    def interpolate(values: FloatArray) -> FloatArray:
        """Return columns at the even times, by cubic splines."""
        result = allocate_matrix(time.size, values.shape[1])
        for j, column in enumerate(values.T):
            result[:, j] = scipy.interpolate.CubicSpline(signals.time, column)(time)
        return result

    dz = None if signals.dz is None else interpolate(signals.dz)
    ddz = None if signals.ddz is None else interpolate(signals.ddz)
    return Signals(time, interpolate(signals.z), dz, ddz, interpolate(signals.tau))
