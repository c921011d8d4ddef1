"""Parts of one recording in several files or topics, such as positions and torques, joined by their times."""

from collections.abc import Sequence

import numpy as np
import scipy  # its interpolate takes a quarter of a second to load, so only when it is used

from paramreduce_cli.errors import DataError
from paramreduce_cli.records import FloatArray, RawLog

_LEAST_COMMON = 0.5
"""Share of the shortest part's duration in which all parts have to be recorded."""
GAP = 5.5
"""Usual time steps that make a gap."""


def join_logs(parts: Sequence[RawLog], time: str) -> RawLog:
    """Return the columns of all parts at the times of the part with the most rows a second.

    Columns of the other parts are interpolated by cubic splines; times at which a part is not recorded are left out.

    Args:
        parts: Parts of one recording, at least one.
        time: Name of the column of times that each part has.

    Raises:
        DataError: A part has no times, times do not increase, two parts have a column of the same name, or they were
            recorded at other times.
    """
    if len(parts) == 1:
        return parts[0]
    times = [_get_times(part, time) for part in parts]
    first, last = max(t[0] for t in times), min(t[-1] for t in times)
    if last - first < _LEAST_COMMON * min(t[-1] - t[0] for t in times):
        spans = ", ".join(
            f"{part.source} from {t[0]:.6g} to {t[-1]:.6g}"
            for part, t in zip(parts, times, strict=True)
        )
        raise DataError(f"parts of one recording have hardly any time in common: {spans}.")
    fastest = max(range(len(parts)), key=lambda k: times[k].size / (times[k][-1] - times[k][0]))
    kept = (times[fastest] >= first) & (times[fastest] <= last)
    at = times[fastest][kept]
    columns: dict[str, FloatArray] = {time: at}
    for k, (part, own) in enumerate(zip(parts, times, strict=True)):
        for name, values in part.columns.items():
            if name == time:
                continue
            if name in columns:
                raise DataError(
                    f"{part.source}: has a column {name} like another part of the recording. Rename one of them."
                )
            columns[name] = values[kept] if k == fastest else _interpolate(own, values, at)
    others = {name: kind for part in parts for name, kind in part.others.items()}
    sources = " + ".join(part.source for part in parts)
    return RawLog(sources, columns, first_line=None, others=others)


def align_column(log: RawLog, name: str, time: str) -> FloatArray:
    """Return a column at the times of a recording: interpolated if it belongs to a topic with times of its own.

    Outside its own times and in their gaps the column is not a number.

    Args:
        log: Log with several topics or groups.
        name: Name of the column.
        time: Name of the column of times.
    """
    values, own = log.columns[name], find_times(log, name, time)
    if own is None or own == time or np.array_equal(log.columns[own], log.columns[time]):
        return values
    recorded_at, at = log.columns[own], log.columns[time]
    steps = np.diff(recorded_at)
    if not np.all(steps > 0):
        return values
    aligned = _interpolate(recorded_at, values, at)
    following = np.clip(np.searchsorted(recorded_at, at), 1, steps.size)
    outside = (at < recorded_at[0]) | (at > recorded_at[-1])
    aligned[outside | (steps[following - 1] > GAP * np.median(steps))] = np.nan
    return aligned


def find_times(log: RawLog, name: str, time: str) -> str | None:
    """Return the name of the column with the times of a column; None if there is none of the same length.

    The times of ``/motors/current/1`` are ``/motors/time_of/current/1`` or ``/motors/time``, where ``time`` is the last part of
    the name of the times of the recording.
    """
    parts, last = name.split("/"), time.rsplit("/", maxsplit=1)[-1]
    for k in range(len(parts) - 1, 0, -1):
        topic = "/".join(parts[:k])
        for candidate in (f"{topic}/{last}_of/{'/'.join(parts[k:])}", f"{topic}/{last}"):
            if candidate in log.columns and log.columns[candidate].size == log.columns[name].size:
                return candidate
    return None


def _get_times(part: RawLog, time: str) -> FloatArray:
    """Return the times of a part; raise DataError if it has none, or if they do not increase."""
    times = part.columns.get(time)
    if times is None or times.size < 2:
        raise DataError(
            f"{part.source}: there is no column {time}, which joins the parts of a recording. Columns: "
            f"{', '.join(part.columns)}."
        )
    wrong = np.flatnonzero(~(np.diff(times) > 0))
    if wrong.size:
        where = part.describe_row(int(wrong[0]) + 1)
        raise DataError(
            f"{where}, column {time}: time does not increase, so parts cannot be joined."
        )
    return times


def _interpolate(recorded_at: FloatArray, values: FloatArray, at: FloatArray) -> FloatArray:
    """Return a column at other times; beside values that are not finite the result is not a number."""
    finite = np.isfinite(values)
    if np.count_nonzero(finite) < 2:
        return np.full(at.size, np.nan)
    result: FloatArray = scipy.interpolate.CubicSpline(recorded_at[finite], values[finite])(at)
    near = np.interp(at, recorded_at, np.where(finite, 0.0, 1.0))
    result[near > 0] = np.nan
    return result
